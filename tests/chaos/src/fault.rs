//! One trial with a failing system call: no space, no memory, no descriptors, a bad disk, or an
//! interruption, injected by `strace`.

use std::fs;
use std::process::Command;
use std::time::{Duration, Instant};

use crate::place::ChaosFolder;
use crate::trial::{
    ChaosRole, ExpectedOutcome, Flaw, TrialOutcome, TrialProcess, command, judge, next_run,
    orphans, other,
};

/// Time for a traced start, plus two seconds of waiting for a peer that may have failed.
const START: Duration = Duration::from_secs(5);
/// Exit code of a program that the dynamic loader cannot load.
const NOT_LOADED: i32 = 127;

/// Returns whether the dynamic loader failed, before the program's first instruction. It crashes if
/// the system refuses its first memory.
fn is_loaders_failure(fault: InjectedFault, number: u32, code: Option<i32>) -> bool {
    code == Some(NOT_LOADED) || (code.is_none() && fault.call == "mmap" && number == 1)
}

/// A system call and the error with which it fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InjectedFault {
    pub call: &'static str,
    pub error: &'static str,
}

const fn fault(error: &'static str, call: &'static str) -> InjectedFault {
    InjectedFault { call, error }
}

/// Errors that disks, memory and signals can cause in the system calls of plant and controller.
pub const FAULTS: [InjectedFault; 25] = [
    fault("ENOSPC", "write"),
    fault("ENOSPC", "openat"),
    fault("ENOSPC", "mkdir"),
    fault("ENOSPC", "ftruncate"),
    fault("ENOSPC", "fsync"),
    fault("EROFS", "openat"),
    fault("EROFS", "mkdir"),
    fault("EROFS", "rename"),
    fault("EIO", "write"),
    fault("EIO", "read"),
    fault("EIO", "fsync"),
    fault("EIO", "getdents64"),
    fault("EMFILE", "openat"),
    fault("EMFILE", "pipe2"),
    fault("ENOMEM", "mmap"),
    fault("ENOMEM", "clone3"),
    fault("EINTR", "write"),
    fault("EINTR", "read"),
    fault("EINTR", "openat"),
    fault("EINTR", "fcntl"),
    fault("ENOSPC", "fallocate"),
    fault("EINTR", "fallocate"),
    fault("EINTR", "clock_nanosleep"),
    fault("EACCES", "openat"),
    fault("EACCES", "unlink"),
];

/// Runs one trial in which the victim's `number`-th call of this kind fails.
///
/// # Errors
/// An error of the system if a process cannot be started or watched.
pub fn run(
    place: &ChaosFolder,
    bus: &str,
    (victim, fault, number): (ChaosRole, InjectedFault, u32),
    expected: &ExpectedOutcome,
) -> std::io::Result<TrialOutcome> {
    let mut findings = Vec::new();
    let log = place.path("strace.log");
    let _ = fs::remove_file(&log);
    let peer_first = number.is_multiple_of(2);
    let start_peer =
        || TrialProcess::start(&mut command(place, other(victim), bus, "out/run.mcap"));
    let mut peer = None;
    if peer_first {
        peer = Some(start_peer()?);
    }
    let plain = command(place, victim, bus, "out/run.mcap");
    let InjectedFault { call, error } = fault;
    let mut traced = Command::new("strace");
    traced
        .args(["-f", "-qq", "-o"])
        .arg(&log)
        .args(["-e", &format!("trace={call}")])
        .args(["-e", &format!("inject={call}:error={error}:when={number}")])
        .arg(plain.get_program())
        .args(plain.get_args());
    let mut victim = TrialProcess::start(place.equip(&mut traced))?;
    let mut peer = match peer {
        Some(peer) => peer,
        None => start_peer()?,
    };
    let deadline = Instant::now() + START + expected.end;
    for (name, process) in [("victim", &mut victim), ("peer", &mut peer)] {
        if !process.wait(deadline)? {
            findings.push((Flaw::Hang, format!("the {name} does not end")));
            continue;
        }
        let (code, text) = process.outcome();
        if !is_loaders_failure(fault, number, code) {
            judge(name, code, &text, &mut findings);
        }
    }
    let reached = fs::read_to_string(&log).is_ok_and(|log| log.contains("(INJECTED)"));
    orphans(place, deadline, &mut findings);
    next_run(place, bus, expected, &mut findings)?;
    Ok(TrialOutcome {
        reached,
        noticed: None,
        findings,
    })
}

//! Trials that disturb the emulator while the bridge waits for it.

use std::fs;
use std::io;
use std::time::{Duration, Instant};

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use crate::arguments::Disturbance;
use crate::host::EMULATOR;
use crate::place::ChaosFolder;
use crate::trial::{
    ChaosRole, ExpectedOutcome, Flaw, NOTICED, Plan, TrialOutcome, TrialProcess, command, judge,
    next_run, orphans,
};

/// Disturbs the emulator of a run, `plan.call` milliseconds after its start.
///
/// # Errors
/// An error of the system if a process cannot be started or watched.
pub fn disturb_emulator(
    place: &ChaosFolder,
    bus: &str,
    plan: Plan,
    expected: &ExpectedOutcome,
) -> io::Result<TrialOutcome> {
    let mut findings = Vec::new();
    let mut run = TrialProcess::start(&mut command(place, ChaosRole::Run, bus, "out/run.mcap"))?;
    let start = Instant::now();
    let mut emulator = None;
    while emulator.is_none() && start.elapsed() < expected.end {
        emulator = place.processes().into_iter().find(|id| is_emulator(*id));
    }
    std::thread::sleep(Duration::from_millis(u64::from(plan.call)));
    let signal = match plan.disturbance {
        Disturbance::Kill => Signal::SIGKILL,
        _ => Signal::SIGSTOP,
    };
    let reached = emulator.is_some_and(|id| kill(Pid::from_raw(id), signal).is_ok());
    let disturbed = Instant::now();
    let mut noticed = None;
    if run.wait(disturbed + expected.end)? {
        let took = disturbed.elapsed();
        let (code, text) = run.outcome();
        noticed = (reached && code == Some(NOTICED)).then_some(took);
        judge("the run", code, &text, &mut findings);
    } else {
        findings.push((Flaw::Hang, "the run does not end".into()));
    }
    orphans(place, disturbed + expected.end, &mut findings);
    next_run(place, bus, expected, &mut findings)?;
    Ok(TrialOutcome {
        reached,
        noticed,
        findings,
    })
}

fn is_emulator(id: i32) -> bool {
    fs::read_link(format!("/proc/{id}/exe")).is_ok_and(|program| program.ends_with(EMULATOR))
}

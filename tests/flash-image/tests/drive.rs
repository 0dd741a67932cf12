//! `painleve drive` end to end: the program is at one end of a pseudo-terminal, the flashed image
//! at the other, with the simulated arm on its sensors and stages.

#![allow(clippy::unwrap_used)]

use std::fs::File;
use std::io::{Read, Write};
use std::os::fd::{AsFd, OwnedFd};
use std::path::PathBuf;
use std::process::{Child, Output, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicUsize, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sys::signal::Signal;
use painleve_flash_image::bench::{BoardBench, scenario};
use painleve_flash_image::board::FlashedBoard;
use painleve_shared::message::{PROTOCOL, Request, Response};
use painleve_shared::wire::{self, Inbox};
use painleve_tests::line::terminal;
use painleve_tests::{errors, signal};

const DEFAULT: &str = "hybrid-elbow-down";
const LIMIT: Duration = Duration::from_secs(120);

/// State shared by the rig's threads.
#[derive(Default)]
struct Observed {
    switch_closed: AtomicBool,
    is_over: AtomicBool,
    /// Whether the torque stages are enabled now.
    is_on: AtomicBool,
    /// Ticks with the stages enabled.
    ticks_on: AtomicU32,
    ticks: AtomicU32,
    /// Bytes that the board has sent.
    sent: AtomicUsize,
}

/// The emulated board with its arm in its own thread, no faster than real time.
struct Rig {
    port: PathBuf,
    observed: Arc<Observed>,
    thread: Option<JoinHandle<()>>,
    _far_end: OwnedFd,
}

impl Rig {
    fn new() -> Self {
        // Building the program takes longer than the board's start.
        painleve_tests::program();
        let (near, far, port) = terminal();
        let observed = Arc::new(Observed::default());
        let shared = Arc::clone(&observed);
        let thread = std::thread::spawn(move || emulate(near, &shared));
        Self {
            port,
            observed,
            thread: Some(thread),
            _far_end: far,
        }
    }

    fn is_on(&self) -> bool {
        self.observed.is_on.load(Ordering::SeqCst)
    }

    fn ticks(&self) -> u32 {
        self.observed.ticks.load(Ordering::SeqCst)
    }

    fn close_switch(&self) {
        self.observed.switch_closed.store(true, Ordering::SeqCst);
    }

    /// Waits until the board is configured and has read its sensors for more than 100 ticks.
    fn wait_for_work(&self) {
        self.wait_until("the board runs", |rig| {
            rig.observed.sent.load(Ordering::SeqCst) > 6000
        });
    }

    fn wait_until(&self, what: &str, is_met: impl Fn(&Self) -> bool) {
        let start = Instant::now();
        while !is_met(self) {
            assert!(start.elapsed() < LIMIT, "timed out waiting until {what}");
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

impl Drop for Rig {
    fn drop(&mut self) {
        self.observed.is_over.store(true, Ordering::SeqCst);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn emulate(mut line: File, observed: &Observed) {
    let scenario = scenario(DEFAULT);
    let mut bench = BoardBench::without_configuration(&scenario, FlashedBoard::booted());
    bench.closes_switch = false;
    let start = Instant::now();
    let mut bytes = [0; 1024];
    for tick in 1.. {
        if observed.is_over.load(Ordering::SeqCst) {
            return;
        }
        while is_readable(&line) {
            let length = line.read(&mut bytes).unwrap();
            bench.board.send_bytes(&bytes[..length]);
        }
        bench
            .board
            .enable(observed.switch_closed.load(Ordering::SeqCst));
        bench.tick();
        let is_on = bench.board.torque().enabled == Some(true);
        observed.is_on.store(is_on, Ordering::SeqCst);
        observed.ticks_on.fetch_add(is_on.into(), Ordering::SeqCst);
        observed.ticks.store(tick, Ordering::SeqCst);
        let sent = bench.board.take_sent();
        observed.sent.fetch_add(sent.len(), Ordering::SeqCst);
        line.write_all(&sent).unwrap();
        let due = Duration::from_millis(tick.into());
        std::thread::sleep(due.saturating_sub(start.elapsed()));
    }
}

fn is_readable(line: &File) -> bool {
    let mut ends = [PollFd::new(line.as_fd(), PollFlags::POLLIN)];
    matches!(poll(&mut ends, PollTimeout::ZERO), Ok(1..))
}

/// A running `painleve drive`.
struct Program {
    child: Child,
    folder: painleve_tests::Bench,
}

impl Program {
    fn start(port: &std::path::Path, more: &[&str]) -> Self {
        let folder = painleve_tests::Bench::new("drive");
        let mut command = folder.command(&["drive", DEFAULT, "--json"]);
        command
            .args(["--set", "converters.force.bits=13", "--port"])
            .arg(port)
            .args(more)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        let child = command.spawn().unwrap();
        Self { child, folder }
    }

    fn order(&mut self, order: &str) {
        let stdin = self.child.stdin.as_mut().unwrap();
        writeln!(stdin, "{order}").unwrap();
    }

    fn end(self) -> (Output, painleve_tests::Bench) {
        (self.child.wait_with_output().unwrap(), self.folder)
    }
}

fn report(output: &Output) -> serde_json::Value {
    assert!(output.status.success(), "{}", errors(output));
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn an_arm_is_driven_after_the_order_and_the_switch_and_recorded() {
    let rig = Rig::new();
    let mut program = Program::start(&rig.port, &["--record", "drive.mcap"]);
    // The switch alone does not arm the drive.
    rig.wait_for_work();
    rig.close_switch();
    let ticks = rig.ticks();
    rig.wait_until("the switch has been closed for a while", |rig| {
        rig.ticks() > ticks + 100
    });
    assert!(!rig.is_on());
    program.order("arm");
    rig.wait_until("the arm is driven", Rig::is_on);
    let ticks = rig.ticks();
    rig.wait_until("it has been driven for a while", |rig| {
        rig.ticks() > ticks + 300
    });
    assert!(rig.is_on());
    program.order("disarm");
    rig.wait_until("the torque is off", |rig| !rig.is_on());
    program.order("stop");
    let (output, folder) = program.end();
    let report = report(&output);
    assert!(report["active_ticks"].as_u64() > Some(300), "{report}");
    assert_eq!(report["lost_ticks"], 0, "{report}");
    assert_eq!(report["fault"], 0, "{report}");
    let text = errors(&output);
    for part in ["arming is permitted", "state: armed", "state: tracking"] {
        assert!(text.contains(part), "{text}");
    }
    let record = std::fs::read(folder.path("drive.mcap")).unwrap();
    let messages = mcap::MessageStream::new(&record).unwrap();
    let topics: Vec<String> = messages
        .map(|it| it.unwrap().channel.topic.clone())
        .collect();
    for topic in ["/plant", "/sensor", "/actuator"] {
        let count = topics.iter().filter(|it| *it == topic).count() as u64;
        assert_eq!(Some(count), report["ticks"].as_u64(), "{topic}");
    }
}

#[test]
fn a_dry_run_keeps_the_stages_off() {
    let rig = Rig::new();
    let mut program = Program::start(
        &rig.port,
        &["--dry-run", "--no-record", "--duration", "0.5"],
    );
    program.order("arm");
    rig.wait_for_work();
    rig.close_switch();
    let (output, _) = program.end();
    assert!(report(&output)["active_ticks"].as_u64() > Some(50));
    assert_eq!(rig.observed.ticks_on.load(Ordering::SeqCst), 0);
}

#[test]
fn ctrl_c_and_a_killed_program_take_the_torque_off() {
    for (by, limit_ticks) in [(Signal::SIGINT, 60), (Signal::SIGKILL, 260)] {
        let rig = Rig::new();
        let mut program = Program::start(&rig.port, &["--no-record"]);
        program.order("arm");
        rig.wait_for_work();
        rig.close_switch();
        rig.wait_until("the arm is driven", Rig::is_on);
        let ticks = rig.ticks();
        signal(program.child.id().cast_signed(), by);
        rig.wait_until("the torque is off", |rig| !rig.is_on());
        assert!(rig.ticks() - ticks < limit_ticks, "{by}");
        let (output, _) = program.end();
        assert_eq!(output.status.success(), by == Signal::SIGINT);
    }
}

/// A board of another build answers; nothing is configured.
#[test]
fn another_build_or_protocol_is_refused_and_both_are_named() {
    let build = painleve_firmware::BUILD;
    for (protocol, build, named) in [
        (
            PROTOCOL + 1,
            build,
            vec![
                format!("protocol {}", PROTOCOL + 1),
                format!("protocol {PROTOCOL}"),
            ],
        ),
        (
            PROTOCOL,
            build ^ 1,
            vec![format!("{build:016x}"), format!("{:016x}", build ^ 1)],
        ),
    ] {
        let (mut line, _far, port) = terminal();
        let program = Program::start(&port, &["--no-record"]);
        let mut inbox = Inbox::new();
        let mut bytes = [0; 1024];
        'asked: loop {
            let length = line.read(&mut bytes).unwrap();
            for byte in &bytes[..length] {
                if let Some(message) = inbox.push(*byte)
                    && matches!(wire::decode(message), Ok(Request::Identify))
                {
                    break 'asked;
                }
            }
        }
        let mut buffer = [0; 96];
        let identity = Response::Identity { protocol, build };
        line.write_all(wire::encode(&identity, &mut buffer).unwrap())
            .unwrap();
        let (output, _) = program.end();
        assert_eq!(output.status.code(), Some(3));
        for part in named {
            assert!(
                errors(&output).contains(&part),
                "{part}: {}",
                errors(&output)
            );
        }
    }
}

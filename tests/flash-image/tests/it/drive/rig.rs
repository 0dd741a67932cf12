//! The emulated board with its arm behind a pseudo-terminal, and the program at the other end.

use std::fs::File;
use std::io::{Read, Write};
use std::os::fd::{AsFd, OwnedFd};
use std::path::{Path, PathBuf};
use std::process::{Child, Output, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use painleve_flash_image::bench::{BoardBench, scenario};
use painleve_flash_image::board::FlashedBoard;
use painleve_plant::scenario::Scenario;
use painleve_tests::line::terminal;

/// The scenario of the simulated arm.
pub const DEFAULT: &str = "hybrid-elbow-down";
const LIMIT: Duration = Duration::from_secs(120);

/// State shared by the rig's threads.
#[derive(Default)]
struct Observed {
    switch_closed: AtomicBool,
    is_over: AtomicBool,
    /// Whether the arm is being carried, or about to be.
    is_carried: AtomicBool,
    /// Whether the torque stages are enabled now.
    is_on: AtomicBool,
    /// Ticks with the stages enabled.
    ticks_on: AtomicU32,
    ticks: AtomicU32,
    /// Bytes that the board has sent.
    sent: AtomicUsize,
}

/// A change of the arm or of its parts.
type Act = Box<dyn FnOnce(&mut BoardBench) + Send>;

/// The emulated board with its arm in its own thread, no faster than real time.
pub struct EmulatedRig {
    /// The program's end of the line.
    pub port: PathBuf,
    observed: Arc<Observed>,
    acts: Sender<Act>,
    thread: Option<JoinHandle<()>>,
    _far_end: OwnedFd,
}

impl EmulatedRig {
    pub fn new() -> Self {
        // Building the program takes longer than the board's start.
        painleve_tests::program();
        let (near, far, port) = terminal();
        let observed = Arc::new(Observed::default());
        let shared = Arc::clone(&observed);
        let (acts, received) = channel();
        let thread = std::thread::spawn(move || emulate(near, &shared, &received));
        Self {
            port,
            observed,
            acts,
            thread: Some(thread),
            _far_end: far,
        }
    }

    /// Changes the arm or its parts at the next tick.
    pub fn act(&self, act: impl FnOnce(&mut BoardBench) + Send + 'static) {
        self.acts.send(Box::new(act)).unwrap();
    }

    pub fn is_on(&self) -> bool {
        self.observed.is_on.load(Ordering::SeqCst)
    }

    /// Returns the number of ticks with the stages enabled.
    pub fn ticks_on(&self) -> u32 {
        self.observed.ticks_on.load(Ordering::SeqCst)
    }

    pub fn ticks(&self) -> u32 {
        self.observed.ticks.load(Ordering::SeqCst)
    }

    /// Closes the switch, as fast as a hand does: it is debounced.
    pub fn close_switch(&self) {
        let ticks = self.ticks();
        self.wait_until("the board has seen the switch open", |rig| {
            rig.ticks() > ticks + 20
        });
        self.observed.switch_closed.store(true, Ordering::SeqCst);
    }

    pub fn open_switch(&self) {
        self.observed.switch_closed.store(false, Ordering::SeqCst);
    }

    /// Has the arm carried to the start of a scenario.
    pub fn carry(&self, scenario: Scenario) {
        self.observed.is_carried.store(true, Ordering::SeqCst);
        self.act(move |bench| bench.carry(&scenario));
        self.wait_until("the arm is there", |rig| {
            !rig.observed.is_carried.load(Ordering::SeqCst)
        });
    }

    /// Waits until the board is configured and has read its sensors for more than 100 ticks.
    pub fn wait_for_work(&self) {
        self.wait_until("the board runs", |rig| {
            rig.observed.sent.load(Ordering::SeqCst) > 6000
        });
    }

    pub fn wait_until(&self, what: &str, is_met: impl Fn(&Self) -> bool) {
        let start = Instant::now();
        while !is_met(self) {
            assert!(start.elapsed() < LIMIT, "timed out waiting until {what}");
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

impl Drop for EmulatedRig {
    fn drop(&mut self) {
        self.observed.is_over.store(true, Ordering::SeqCst);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn emulate(mut line: File, observed: &Observed, acts: &Receiver<Act>) {
    let scenario = scenario(DEFAULT);
    let mut bench = BoardBench::without_configuration(&scenario, FlashedBoard::booted());
    bench.closes_switch = false;
    let mut due = Instant::now();
    let mut bytes = [0; 1024];
    for tick in 1.. {
        if observed.is_over.load(Ordering::SeqCst) {
            return;
        }
        for act in acts.try_iter() {
            act(&mut bench);
        }
        let is_carried = bench.is_carried();
        while is_readable(&line) {
            let length = line.read(&mut bytes).unwrap();
            bench.board.send_bytes(&bytes[..length]);
        }
        bench
            .board
            .enable(observed.switch_closed.load(Ordering::SeqCst));
        bench.tick();
        if is_carried && !bench.is_carried() {
            observed.is_carried.store(false, Ordering::SeqCst);
        }
        let is_on = bench.board.torque().enabled == Some(true);
        observed.is_on.store(is_on, Ordering::SeqCst);
        observed.ticks_on.fetch_add(is_on.into(), Ordering::SeqCst);
        observed.ticks.store(tick, Ordering::SeqCst);
        let sent = bench.board.take_sent();
        observed.sent.fetch_add(sent.len(), Ordering::SeqCst);
        line.write_all(&sent).unwrap();
        // The board does not catch up on a late tick: in a burst of ticks it would miss heartbeats
        // that the program sends in time.
        due = (due + Duration::from_millis(1)).max(Instant::now());
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
    }
}

pub fn is_readable(line: &File) -> bool {
    let mut ends = [PollFd::new(line.as_fd(), PollFlags::POLLIN)];
    matches!(poll(&mut ends, PollTimeout::ZERO), Ok(1..))
}

/// A running `painleve`.
pub struct StartedProgram {
    pub child: Child,
    pub folder: painleve_tests::Bench,
    /// What it has said on standard error, as far as it has been waited for.
    said: Vec<u8>,
}

impl StartedProgram {
    /// Starts `painleve drive` with further options.
    pub fn drive(port: &Path, more: &[&str]) -> Self {
        let folder = painleve_tests::Bench::new("drive");
        Self::start(
            folder,
            port,
            &[&["drive", DEFAULT, "--json"], more].concat(),
        )
    }

    /// Starts a subcommand for the arm behind `port`.
    pub fn start(folder: painleve_tests::Bench, port: &Path, arguments: &[&str]) -> Self {
        let mut command = folder.command(arguments);
        command
            .arg("--port")
            .arg(port)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        let child = command.spawn().unwrap();
        Self {
            child,
            folder,
            said: Vec::new(),
        }
    }

    /// Waits until it has said this on standard error.
    pub fn wait_for(&mut self, part: &str) {
        let stderr = self.child.stderr.as_mut().unwrap();
        while !String::from_utf8_lossy(&self.said).contains(part) {
            let mut some = [0; 256];
            let count = stderr.read(&mut some).unwrap();
            self.said.extend_from_slice(&some[..count]);
            assert!(count > 0, "{}", String::from_utf8_lossy(&self.said));
        }
    }

    /// Types a line.
    pub fn order(&mut self, order: &str) {
        let stdin = self.child.stdin.as_mut().unwrap();
        writeln!(stdin, "{order}").unwrap();
    }

    /// Returns what it has said when it has ended.
    pub fn end(self) -> (Output, painleve_tests::Bench) {
        let mut output = self.child.wait_with_output().unwrap();
        output.stderr.splice(0..0, self.said);
        (output, self.folder)
    }
}

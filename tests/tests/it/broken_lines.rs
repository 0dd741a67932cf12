//! Serial lines that break, that another program uses, or that carry no frames.

#![allow(clippy::unwrap_used)]

use std::fs::{File, Permissions};
use std::io::{BufRead, BufReader, Read, Write};
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, OnceLock};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::unistd::Uid;
use painleve_commission::simulated::SimulatedRig;
use painleve_commission::{OperatorTask, Rig};
use painleve_firmware::SOURCES;
use painleve_plant::law_choice::build;
use painleve_plant::scenario::Scenario;
use painleve_plant::scenario::built_in::DEFAULT;
use painleve_shared::Posture;
use painleve_shared::black_box::BlackBox;
use painleve_shared::counts::TorqueCounts;
use painleve_shared::frame::{ActuatorFrame, SensorFrame};
use painleve_shared::message::{Health, PROTOCOL, Request, Response};
use painleve_shared::status::SupervisorState;
use painleve_shared::wire::{self, Inbox};
use painleve_tests::line::terminal;
use painleve_tests::{Bench, errors, program, skipped};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Time from the last byte until `drive` and `commission` have ended: 1.5 s for the board's silence and for the attempt
/// to stop it, and a margin for a busy machine.
const END: Duration = Duration::from_secs(4);

/// Control rate of the arm, at which its time passes four times as fast as the board's.
const RATE: [&str; 2] = ["--set", "run.tick_hz=250"];

/// What remains of a broken line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Break {
    /// A cut cable.
    Silence,
    /// An adapter without power.
    Unplugged,
    /// A loose plug, or a board that has started another program.
    Garbage,
}

/// A board with an arm at one end of a line, which may break after a number of bytes from the board.
struct Board {
    port: PathBuf,
    arm: Arc<Mutex<SimulatedRig>>,
    state: Arc<BoardState>,
    thread: Option<JoinHandle<()>>,
    /// Keeps the line from hanging up between programs.
    far_end: Option<OwnedFd>,
}

#[derive(Default)]
struct BoardState {
    sent_bytes: AtomicUsize,
    /// Ticks sent whole.
    sent_ticks: AtomicUsize,
    broken: OnceLock<Instant>,
    is_over: AtomicBool,
}

impl Board {
    /// A line that breaks after `intact` bytes.
    fn new(intact: usize, break_: Break) -> Self {
        program();
        let (line, far_end, port) = terminal();
        let scenario = Scenario::load("hybrid-elbow-down", &[RATE[1].to_owned()]).unwrap();
        let arm = Arc::new(Mutex::new(SimulatedRig::new(&scenario, None, 1)));
        let state = Arc::new(BoardState::default());
        let end = BoardEnd {
            line,
            intact,
            state: Arc::clone(&state),
        };
        let shared = Arc::clone(&arm);
        let thread = std::thread::spawn(move || end.work(&shared, break_));
        Self {
            port,
            arm,
            state,
            thread: Some(thread),
            far_end: Some(far_end),
        }
    }

    fn wait_for_ticks(&self, ticks: usize) {
        let start = Instant::now();
        while self.state.sent_ticks.load(Ordering::SeqCst) < ticks {
            assert!(start.elapsed() < Duration::from_secs(20), "no ticks");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// Starts the program at the other end.
    fn start(&self, bench: &Bench, arguments: &[&str]) -> Child {
        let mut command = bench.command(arguments);
        command.arg("--port").arg(&self.port);
        for set in [Command::stdin, Command::stdout, Command::stderr] {
            set(&mut command, Stdio::piped());
        }
        command.spawn().unwrap()
    }

    /// Returns how long after the line's end a program has ended.
    fn outlived(&self, ended: Instant) -> Duration {
        let broken = self.state.broken.get().expect("the line has broken");
        ended.saturating_duration_since(*broken)
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        self.state.is_over.store(true, Ordering::SeqCst);
        // Ends a write to a full line that no program reads any more.
        self.far_end = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// The board's end of the line.
struct BoardEnd {
    line: File,
    /// Bytes until the line breaks.
    intact: usize,
    state: Arc<BoardState>,
}

impl BoardEnd {
    fn work(mut self, arm: &Mutex<SimulatedRig>, break_: Break) {
        let mut inbox = Inbox::new();
        let mut is_running = false;
        let mut torques = [TorqueCounts(0); 2];
        let mut answer = ActuatorFrame::default();
        let mut due = Instant::now();
        let mut tick = 0_u32;
        while !self.state.is_over.load(Ordering::SeqCst) && self.intact > 0 {
            for byte in self.received() {
                let Some(message) = inbox.push(byte) else {
                    continue;
                };
                let response = match wire::decode(message) {
                    Ok(Request::Identify) => Response::Identity {
                        protocol: PROTOCOL,
                        build: build(),
                    },
                    Ok(Request::Sources) => Response::Sources(SOURCES),
                    Ok(Request::BlackBox) => Response::BlackBox(BlackBox::default()),
                    Ok(Request::Configure { .. }) => {
                        is_running = true;
                        Response::Ready { stopwatch_hz: 1 }
                    }
                    Ok(Request::Stop) => {
                        is_running = false;
                        Response::Stopped
                    }
                    Ok(Request::Health) => Response::Health(Health::default()),
                    Ok(Request::PermitArming(permitted)) => {
                        answer.state = SupervisorState::Armed as u8;
                        Response::Permission(permitted)
                    }
                    Ok(Request::Torque(commanded)) => {
                        torques = commanded;
                        continue;
                    }
                    _ => continue,
                };
                self.send(&response);
            }
            if is_running {
                let raw = arm.lock().unwrap().exchange(torques).unwrap();
                let sensor = SensorFrame {
                    tick,
                    sequence: tick,
                    joints: raw.joints,
                    tangential_force: raw.forces[0],
                    normal_force: raw.forces[1],
                    ..SensorFrame::default()
                };
                tick = tick.wrapping_add(1);
                let elapsed = 0;
                let is_whole = self.send(&Response::Tick {
                    sensor,
                    answer,
                    elapsed,
                });
                let whole = usize::from(is_whole);
                self.state.sent_ticks.fetch_add(whole, Ordering::SeqCst);
            }
            due = (due + Duration::from_millis(1)).max(Instant::now());
            std::thread::sleep(due.saturating_duration_since(Instant::now()));
        }
        let _ = self.state.broken.set(Instant::now());
        if break_ == Break::Unplugged {
            return;
        }
        let mut random = Pcg64::seed_from_u64(2);
        while !self.state.is_over.load(Ordering::SeqCst) {
            self.received();
            if break_ == Break::Garbage {
                self.write(&random.random::<[u8; 8]>());
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    fn received(&mut self) -> Vec<u8> {
        let mut ends = [PollFd::new(self.line.as_fd(), PollFlags::POLLIN)];
        if !matches!(poll(&mut ends, PollTimeout::ZERO), Ok(1..)) {
            return Vec::new();
        }
        let mut bytes = vec![0; 4096];
        let read = self.line.read(&mut bytes);
        let length = self.unless_over(read).unwrap_or(0);
        bytes.truncate(length);
        bytes
    }

    fn write(&mut self, bytes: &[u8]) {
        let written = self.line.write_all(bytes);
        self.unless_over(written);
    }

    /// Unwraps a result of the line, which fails at the end of the test.
    fn unless_over<T>(&self, result: std::io::Result<T>) -> Option<T> {
        if self.state.is_over.load(Ordering::SeqCst) {
            result.ok()
        } else {
            Some(result.unwrap())
        }
    }

    /// Sends a response, or what the line still carries of it; returns whether it was whole.
    fn send(&mut self, response: &Response) -> bool {
        let mut buffer = [0; 192];
        let bytes = wire::encode(response, &mut buffer).unwrap();
        let carried = bytes.len().min(self.intact);
        self.write(&bytes[..carried]);
        self.intact -= carried;
        self.state.sent_bytes.fetch_add(carried, Ordering::SeqCst);
        carried == bytes.len()
    }
}

fn output(child: Child) -> (Output, Instant) {
    let output = child.wait_with_output().unwrap();
    (output, Instant::now())
}

/// Plays the operator of `commission`, who does every task at once.
fn commission(board: &Board, bench: &Bench) -> (Output, Instant, String) {
    let arguments = [
        "commission",
        DEFAULT,
        RATE[0],
        RATE[1],
        "--output",
        "found.toml",
    ];
    let mut child = board.start(bench, &arguments);
    let mut text = String::new();
    for line in BufReader::new(child.stderr.take().unwrap()).lines() {
        let line = line.unwrap();
        text += &(line.clone() + "\n");
        let hold = |plumb_deg| Some(OperatorTask::Hold { plumb_deg });
        let task = if line.contains("hold link 1 straight down, and link 2 level") {
            hold([0.0, 90.0])
        } else if line.contains("and link 2 level") {
            hold([90.0, 90.0])
        } else if line.contains("and link 2 straight down") {
            hold([if line.contains("1 level") { 90.0 } else { 0.0 }, 0.0])
        } else if line.contains("set the tip on it") {
            let posture = Posture::ElbowDown;
            Some(OperatorTask::SetDown { posture })
        } else if line.contains("switch ENABLE") {
            Some(OperatorTask::Enable)
        } else {
            None
        };
        if let Some(task) = task {
            board.arm.lock().unwrap().instruct(task).unwrap();
            // The program may have ended meanwhile.
            let _ = child.stdin.as_mut().unwrap().write_all(b"\n");
        }
    }
    let (output, ended) = output(child);
    (output, ended, text)
}

/// Checks how a program has ended whose line broke as `break_` after `intact` bytes.
fn check_end(what: &str, board: &Board, ended: Instant, code: Option<i32>, text: &str) {
    assert_eq!(code, Some(3), "{what}: {text}");
    let outlived = board.outlived(ended);
    assert!(outlived < END, "{what}: {outlived:?}, {text}");
    let error = text.lines().find(|line| line.starts_with("error: "));
    let error = error.unwrap_or_else(|| panic!("{what}: {text}"));
    let messages = [
        "the board has not answered for ",
        "the serial port is gone: the board or its adapter has been unplugged",
    ];
    assert!(
        messages.iter().any(|message| error.contains(message)),
        "{what}: {error}"
    );
}

fn drive_on_broken_line(intact: usize, break_: Break) {
    let what = format!("drive, {break_:?} after {intact} bytes");
    let bench = Bench::new("broken");
    let board = Board::new(intact, break_);
    let arguments = ["drive", DEFAULT, RATE[0], RATE[1], "--record", "drive.mcap"];
    let (output, ended) = output(board.start(&bench, &arguments));
    let text = errors(&output);
    check_end(&what, &board, ended, output.status.code(), &text);
    // Whatever arrived is kept.
    let ticks = board.state.sent_ticks.load(Ordering::SeqCst);
    let files = bench.files();
    if files.is_empty() {
        assert!(ticks == 0 || break_ == Break::Unplugged, "{what}: {text}");
        return;
    }
    assert_eq!(files, ["drive.partial.mcap"], "{what}");
    let record = std::fs::read(bench.path(&files[0])).unwrap();
    let messages = mcap::MessageStream::new(&record).unwrap();
    let recorded = messages.filter(|it| it.as_ref().unwrap().channel.topic == "/sensor");
    let recorded = recorded.count();
    // The system drops what has arrived on a port that is unplugged.
    let is_complete = recorded == ticks || break_ == Break::Unplugged && recorded < ticks;
    assert!(is_complete, "{what}: {recorded} of {ticks} ticks");
}

fn commission_on_broken_line(intact: usize, break_: Break) {
    let what = format!("commission, {break_:?} after {intact} bytes");
    let bench = Bench::new("broken");
    let board = Board::new(intact, break_);
    let (output, ended, text) = commission(&board, &bench);
    check_end(&what, &board, ended, output.status.code(), &text);
    assert!(bench.files().is_empty(), "{what}");
}

/// Lines that break, of either command.
const BROKEN_LINES: usize = 8;

#[test]
fn drive_and_commission_end_in_time_when_the_line_breaks_at_any_byte() {
    // The whole procedure on a line that does not break.
    let board = Board::new(usize::MAX, Break::Silence);
    let (output, _, text) = commission(&board, &Bench::new("whole"));
    assert!(output.status.success(), "{text}");
    let whole = board.state.sent_bytes.load(Ordering::SeqCst);
    drop(board);

    let mut random = Pcg64::seed_from_u64(1);
    let breaks = [Break::Silence, Break::Unplugged, Break::Garbage];
    let cuts: Vec<_> = (0..BROKEN_LINES)
        .map(|index| {
            // A drive's first answers, or its ticks.
            let drive = random.random_range(0..if index % 2 == 0 { 150 } else { 20_000 });
            let commission = random.random_range(0..whole);
            (drive, commission, breaks[index % breaks.len()])
        })
        .collect();
    std::thread::scope(|scope| {
        for (drive, commission, break_) in cuts {
            scope.spawn(move || drive_on_broken_line(drive, break_));
            scope.spawn(move || commission_on_broken_line(commission, break_));
        }
    });
}

/// Opens a port as another user's program would that knows nothing of locks.
fn open_elsewhere(port: &Path) -> Option<Output> {
    let read_nothing = |mut command: Command| {
        let source = format!("if={}", port.display());
        command.args([source.as_str(), "count=0"]).output().ok()
    };
    if !Uid::effective().is_root() {
        return read_nothing(Command::new("dd"));
    }
    // Root may open what is in exclusive use.
    std::fs::set_permissions(port, Permissions::from_mode(0o666)).unwrap();
    let mut nobody = Command::new("setpriv");
    nobody.args(["--reuid=65534", "--regid=65534", "--clear-groups", "dd"]);
    read_nothing(nobody)
}

#[test]
fn a_port_in_use_is_refused_by_every_command_and_its_user_is_not_disturbed() {
    let board = Board::new(usize::MAX, Break::Silence);
    let bench = Bench::new("in-use");
    let drive = ["drive", DEFAULT, "--dry-run", "--no-record", "--json"];
    let mut user = board.start(&bench, &drive);
    board.wait_for_ticks(100);

    let plant = bench.start(&["plant", "--bus", &bench.bus, "--no-record", "--no-plot"]);
    let scenario = "hybrid-elbow-down";
    for arguments in [
        &["run", scenario, "--host", "serial"][..],
        &["bridge", "serial", "--bus", &bench.bus],
        &drive,
        &["drive", "--stored"],
        &["commission", DEFAULT],
        &["timing", scenario, "--host", "serial"],
    ] {
        let (output, _) = output(board.start(&bench, arguments));
        let text = errors(&output);
        assert_eq!(output.status.code(), Some(3), "{arguments:?}: {text}");
        let port = board.port.display();
        let message = format!("the serial port {port} is in use by another program");
        assert!(text.contains(&message), "{arguments:?}: {text}");
    }
    drop(plant);
    match open_elsewhere(&board.port) {
        Some(output) => assert!(errors(&output).contains("busy"), "{}", errors(&output)),
        None => skipped("no `setpriv` or `dd`"),
    }

    writeln!(user.stdin.as_mut().unwrap(), "stop").unwrap();
    let (output, _) = output(user);
    assert!(output.status.success(), "{}", errors(&output));
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["lost_ticks"], 0, "{report}");
    if let Some(output) = open_elsewhere(&board.port) {
        assert!(output.status.success(), "{}", errors(&output));
    }
}

#[test]
fn bytes_that_are_no_frames_are_told_from_silence() {
    let start = |arguments: &[&str], break_| {
        let (board, bench) = (Board::new(0, break_), Bench::new("garbage"));
        let (output, _) = output(board.start(&bench, arguments));
        let text = errors(&output);
        assert_eq!(output.status.code(), Some(3), "{arguments:?}: {text}");
        assert!(text.contains("the board has not answered for 1."), "{text}");
        let is_told = text.contains(" bytes, none of them a frame: wrong baud rate");
        assert_eq!(is_told, break_ == Break::Garbage, "{arguments:?}: {text}");
    };
    std::thread::scope(|scope| {
        for break_ in [Break::Garbage, Break::Silence] {
            for arguments in [
                &["drive", DEFAULT, "--no-record"][..],
                &["drive", "--stored"],
                &["commission", DEFAULT],
                &["timing", "hybrid-elbow-down", "--host", "serial"],
                &["run", "--host", "serial", "--no-record", "--no-plot"],
            ] {
                scope.spawn(move || start(arguments, break_));
            }
        }
    });
}

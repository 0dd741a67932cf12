//! A serial line of 921,600 baud between two pseudo-terminals, with realistic transmission times
//! and optional disturbances. QEMU can run the image with the flash target's driver at its far end.

use std::fs::File;
use std::io::{Read, Write};
use std::os::fd::{AsFd, OwnedFd};
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::pty::openpty;
use nix::sys::signal::Signal;
use nix::sys::termios::{SetArg, cfmakeraw, tcgetattr, tcsetattr};
use nix::unistd::ttyname;
use painleve_board::{SILENCE_LIMIT, Serial};
use painleve_plant::scenario::Scenario;
use painleve_process::lifetime::{Guarded, end_with_parent};
use painleve_shared::message::FrameSource;

use crate::image;

/// Duration of a byte: start bit, eight bits, stop bit at 921,600 baud.
const BYTE: Duration = Duration::from_nanos(10_851);

/// Bytes that are forwarded together, a third of a millisecond.
const CHUNK: usize = 32;

/// Undisturbed messages at the start, including the configuration.
const QUIET_MESSAGES: u64 = 20;

/// Disturbances of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LineNoise {
    /// No disturbances.
    None,
    /// Of every twelve messages in each direction, one has a flipped bit, one is followed by
    /// garbage and one is merged with garbage.
    Steady,
}

/// Directions of the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// From host to board: requests.
    ToBoard = 0,
    /// From board to host: responses.
    ToHost = 1,
}

/// A serial line; removed when dropped.
pub struct SerialLine {
    /// The port at the host's end.
    pub host_port: PathBuf,
    /// The port at the board's end.
    pub board_port: PathBuf,
    disturbances: [Arc<AtomicU64>; 2],
    is_over: Arc<AtomicBool>,
    carriers: Vec<JoinHandle<()>>,
    /// Kept open, so that either end may disconnect and reconnect.
    _ends: [OwnedFd; 2],
}

impl SerialLine {
    /// Creates a line.
    ///
    /// # Panics
    /// If the system has no pseudo-terminals.
    pub fn new(noise: LineNoise) -> Self {
        let (host, host_end, host_port) = terminal();
        let (board, board_end, board_port) = terminal();
        let is_over = Arc::new(AtomicBool::new(false));
        let disturbances = [Arc::default(), Arc::default()];
        let copy = |file: &File| file.try_clone().unwrap_or_else(|error| panic!("{error}"));
        let ways = [
            (copy(&host), copy(&board), Direction::ToBoard),
            (board, host, Direction::ToHost),
        ];
        let carriers = ways.map(|(from, to, direction)| {
            let is_over = Arc::clone(&is_over);
            let disturber = Disturber {
                noise,
                message: Vec::new(),
                messages: 0,
                random: 1 + direction as u32,
                count: Arc::clone(&disturbances[direction as usize]),
            };
            std::thread::spawn(move || carry(from, to, disturber, &is_over))
        });
        Self {
            host_port,
            board_port,
            disturbances,
            is_over,
            carriers: carriers.into(),
            _ends: [host_end, board_end],
        }
    }

    /// Returns the number of messages disturbed or added.
    pub fn disturbances(&self, direction: Direction) -> u64 {
        self.disturbances[direction as usize].load(Ordering::SeqCst)
    }

    /// Starts the image in QEMU at the end of the line and waits until it answers.
    ///
    /// # Panics
    /// If QEMU cannot be started, or its image does not answer.
    pub fn start_board(&self) -> SerialBoard {
        let device = format!("serial,id=line,path={}", self.board_port.display());
        let child = emulator(&device).stdout(Stdio::null()).spawn();
        let board = SerialBoard(Guarded::new(
            child.unwrap_or_else(|error| panic!("cannot start QEMU: {error}")),
        ));
        let configuration = Scenario::default().controller_configuration();
        let answers = || {
            Serial::open(
                &self.host_port,
                &configuration,
                FrameSource::Lockstep,
                SILENCE_LIMIT,
            )
            .is_ok()
        };
        assert!((0..20).any(|_| answers()), "the board says nothing");
        board
    }
}

/// Returns the command that runs the image in QEMU, with its serial line at the character device `line`, and ends with the
/// thread that starts it.
pub fn emulator(device: &str) -> Command {
    let mut command = Command::new("qemu-system-arm");
    command
        .args(["-machine", "netduinoplus2", "-display", "none"])
        .args(["-monitor", "none", "-nodefaults"])
        .args(["-semihosting-config", "enable=on,target=native"])
        .args(["-chardev", device, "-serial", "chardev:line"])
        // 64 ns per instruction, however busy the machine is, so no tick takes longer. While it
        // waits, the board follows the host's clock.
        .args(["-icount", "shift=6,sleep=on"])
        .arg("-kernel")
        .arg(image())
        .stdin(Stdio::null());
    end_with_parent(&mut command, Signal::SIGKILL);
    command
}

/// An emulated board on a line; disconnected when dropped.
pub struct SerialBoard(Guarded);

impl Drop for SerialBoard {
    fn drop(&mut self) {
        self.0.kill();
    }
}

impl Drop for SerialLine {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::SeqCst);
        for carrier in self.carriers.drain(..) {
            let _ = carrier.join();
        }
    }
}

/// A pseudo-terminal without processing: its near end, its far end kept open, the far end's path.
///
/// # Panics
/// If the system has none.
pub fn terminal() -> (File, OwnedFd, PathBuf) {
    let pair = openpty(None, None).unwrap_or_else(|error| panic!("no pseudo-terminal: {error}"));
    let raw = tcgetattr(&pair.slave).and_then(|mut settings| {
        cfmakeraw(&mut settings);
        tcsetattr(&pair.slave, SetArg::TCSANOW, &settings)
    });
    raw.unwrap_or_else(|error| panic!("a pseudo-terminal cannot be set: {error}"));
    let name = ttyname(&pair.slave);
    let name = name.unwrap_or_else(|error| panic!("a pseudo-terminal has no name: {error}"));
    (File::from(pair.master), pair.slave, name)
}

fn carry(mut from: File, mut to: File, mut disturber: Disturber, is_over: &AtomicBool) {
    let mut free_at = Instant::now();
    let mut bytes = [0; CHUNK];
    while !is_over.load(Ordering::SeqCst) {
        let mut ends = [PollFd::new(from.as_fd(), PollFlags::POLLIN)];
        if !matches!(poll(&mut ends, PollTimeout::from(20_u8)), Ok(1..)) {
            continue;
        }
        let Ok(length) = from.read(&mut bytes) else {
            return;
        };
        for piece in disturber.pass(&bytes[..length]).chunks(CHUNK) {
            free_at = free_at.max(Instant::now()) + BYTE * piece.len() as u32;
            std::thread::sleep(free_at.saturating_duration_since(Instant::now()));
            if to.write_all(piece).is_err() {
                return;
            }
        }
    }
}

/// Selects disturbances, the same in every run. Holds a message until it is complete.
struct Disturber {
    noise: LineNoise,
    message: Vec<u8>,
    /// Number of messages.
    messages: u64,
    random: u32,
    count: Arc<AtomicU64>,
}

impl Disturber {
    fn pass(&mut self, bytes: &[u8]) -> Vec<u8> {
        if self.noise == LineNoise::None {
            return bytes.to_vec();
        }
        let mut passed = Vec::new();
        for byte in bytes {
            self.message.push(*byte);
            if *byte == 0 {
                self.disturb();
                passed.append(&mut self.message);
            }
        }
        passed
    }

    fn disturb(&mut self) {
        self.messages += 1;
        if self.messages < QUIET_MESSAGES {
            return;
        }
        match self.messages % 12 {
            0 => self.flip(),
            4 => {
                self.garbage();
                self.message.push(0);
            }
            // It merges with the next message.
            8 => self.garbage(),
            _ => return,
        }
        self.count.fetch_add(1, Ordering::SeqCst);
    }

    /// Flips a bit in the middle of the message without creating or removing a delimiter.
    fn flip(&mut self) {
        let at = self.message.len() / 2;
        if let Some(byte) = self.message.get_mut(at) {
            *byte ^= if *byte == 1 { 2 } else { 1 };
        }
    }

    /// Returns up to 60 bytes without a delimiter; sometimes more than the longest message.
    fn garbage(&mut self) {
        let length = match self.next() % 16 {
            0 => 900,
            some => 4 * some,
        };
        for _ in 0..length {
            let byte = (self.next() % 255) as u8 + 1;
            self.message.push(byte);
        }
    }

    /// Marsaglia's xorshift.
    fn next(&mut self) -> u32 {
        self.random ^= self.random << 13;
        self.random ^= self.random >> 17;
        self.random ^= self.random << 5;
        self.random
    }
}

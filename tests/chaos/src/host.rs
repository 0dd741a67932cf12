//! The host of the controller during chaos: a native process, the image under QEMU, or the image
//! behind a serial line.

use std::fs::{File, OpenOptions};
use std::io::{self, BufRead, BufReader};
use std::os::fd::AsFd;
use std::path::Path;
use std::process::{Child, Stdio};

use nix::fcntl::OFlag;
use nix::sys::termios::{SetArg, cfmakeraw, tcgetattr, tcsetattr};
use painleve_tests::line::emulator;
use rustix::termios::ioctl_tiocnxcl;
use serde_json::Value;

use crate::arguments::ChaosHost;

pub const EMULATOR: &str = "qemu-system-arm";

/// A running host with its command-line arguments.
pub struct ChaosController {
    kind: ChaosHost,
    /// Path of the image, or of the port.
    path: String,
    board: Option<SerialBoard>,
}

impl ChaosController {
    /// Starts the processes of the host.
    ///
    /// # Errors
    /// If the emulator is not installed.
    pub fn start(kind: ChaosHost) -> io::Result<Self> {
        let (path, board) = match kind {
            ChaosHost::Native => (String::new(), None),
            ChaosHost::Qemu => {
                let image = painleve_tests::image().to_string_lossy();
                (image.into_owned(), None)
            }
            ChaosHost::Serial => {
                let board = SerialBoard::start()?;
                (board.port.clone(), Some(board))
            }
        };
        Ok(Self { kind, path, board })
    }

    /// Returns the arguments that start the controller's process.
    pub fn controller(&self) -> Vec<&str> {
        match self.kind {
            ChaosHost::Native => vec!["controller"],
            ChaosHost::Qemu => vec!["bridge", "qemu", "--elf", &self.path],
            ChaosHost::Serial => self.on_port(vec!["bridge", "serial", "--port", &self.path]),
        }
    }

    /// Returns the arguments that start a run.
    pub fn run(&self) -> Vec<&str> {
        match self.kind {
            ChaosHost::Native => vec!["run"],
            ChaosHost::Qemu => vec!["run", "--host", "qemu", "--elf", &self.path],
            ChaosHost::Serial => {
                self.on_port(vec!["run", "--host", "serial", "--port", &self.path])
            }
        }
    }

    /// Returns the arguments of a program on the port, after the end of the exclusive mode that a killed one has left
    /// there: the board's end outlasts it.
    fn on_port<'a>(&self, arguments: Vec<&'a str>) -> Vec<&'a str> {
        if let Some(board) = &self.board {
            let _ = ioctl_tiocnxcl(&board.end);
        }
        arguments
    }

    /// Returns the part of a report that is the same in every undisturbed run: the hash of all
    /// frames. Over a serial line a repeated request has a different sequence number; there it is
    /// the motion of the arm.
    pub fn course(&self, report: &str) -> Option<String> {
        let report: Value = serde_json::from_str(report).ok()?;
        if self.kind != ChaosHost::Serial {
            return Some(report["log_hash"].as_str()?.to_owned());
        }
        let keys = ["ticks", "fault", "final_tip_t_m", "peak_torque_nm"];
        Some(keys.map(|key| report[key].to_string()).join(" "))
    }
}

/// The image at the end of a serial line, for all trials of a worker.
struct SerialBoard {
    emulator: Child,
    port: String,
    /// Kept open, because the emulator drops the board's output while this end is closed.
    end: File,
}

impl SerialBoard {
    fn start() -> io::Result<Self> {
        let mut emulator = emulator("pty,id=line")
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()?;
        let output = emulator.stdout.take();
        let mut output = BufReader::new(output.ok_or_else(|| io::Error::other("no pipe"))?);
        let mut line = String::new();
        output.read_line(&mut line)?;
        let port = line
            .split_whitespace()
            .find(|word| word.starts_with("/dev/"));
        let port = port.ok_or_else(|| io::Error::other(format!("{EMULATOR}: {line}")))?;
        let port = port.to_owned();
        // The image's log must not fill the pipe.
        std::thread::spawn(move || io::copy(&mut output, &mut io::sink()));
        let end = open(Path::new(&port))?;
        Ok(Self {
            emulator,
            port,
            end,
        })
    }
}

impl Drop for SerialBoard {
    fn drop(&mut self) {
        let _ = self.emulator.kill();
        let _ = self.emulator.wait();
    }
}

fn open(port: &Path) -> io::Result<File> {
    use std::os::unix::fs::OpenOptionsExt;
    let end = OpenOptions::new()
        .read(true)
        .write(true)
        .custom_flags(OFlag::O_NOCTTY.bits())
        .open(port)?;
    let mut settings = tcgetattr(end.as_fd())?;
    cfmakeraw(&mut settings);
    tcsetattr(end.as_fd(), SetArg::TCSANOW, &settings)?;
    Ok(end)
}

//! `painleve bridge`: the controller's image on a board, joined to the plant's bus.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::{Args, Subcommand};
use painleve_firmware::Configuration;

use super::CommandError;
use crate::atomic_file::AtomicFile;
use crate::board::emulator::{self, Emulator};
use crate::board::{TickTimes, TimingReport};
use crate::interrupt::Interrupt;
use crate::lifetime;
use crate::link::{BusName, ControllerEnd, Received};

/// Options of `painleve bridge`.
#[derive(Debug, Args)]
pub struct BridgeArguments {
    #[command(subcommand)]
    board: Board,
}

#[derive(Debug, Subcommand)]
enum Board {
    /// The image under QEMU: deterministic, with instruction counts.
    Qemu(QemuArguments),
}

#[derive(Debug, Args)]
struct QemuArguments {
    /// Bus on which the plant is.
    #[arg(long)]
    bus: BusName,
    #[command(flatten)]
    image: ImageArguments,
    /// How long to wait for the plant, s.
    #[arg(long, value_name = "SECONDS", default_value_t = 1.8, value_parser = super::seconds)]
    wait_s: f64,
    /// End when the process that started this one does.
    #[arg(long, hide = true)]
    end_with_parent: bool,
}

/// Which image to run, and what to keep of it.
#[derive(Clone, Debug, Default, Args)]
pub struct ImageArguments {
    /// The controller's image; the workspace's own build by default.
    #[arg(long, value_name = "PATH")]
    elf: Option<PathBuf>,
    /// Print what the image says.
    #[arg(long)]
    pub log: bool,
    /// Write what every tick cost as JSON.
    #[arg(long, value_name = "PATH")]
    timing: Option<PathBuf>,
}

impl ImageArguments {
    /// The image to run.
    pub fn path(&self) -> PathBuf {
        self.elf.clone().unwrap_or_else(emulator::default_image)
    }

    /// The same as command-line arguments, for a child process.
    pub fn to_arguments(&self) -> Vec<std::ffi::OsString> {
        let mut arguments = Vec::new();
        for (option, path) in [("--elf", &self.elf), ("--timing", &self.timing)] {
            if let Some(path) = path {
                arguments.extend([option.into(), path.into()]);
            }
        }
        if self.log {
            arguments.push("--log".into());
        }
        arguments
    }
}

/// Carries frames between the bus and the board until the plant's session ends.
pub fn run(arguments: &BridgeArguments) -> Result<(), CommandError> {
    let Board::Qemu(arguments) = &arguments.board;
    if arguments.end_with_parent {
        lifetime::end_with_parent()?;
    }
    let interrupt = Interrupt::catch().map_err(|error| CommandError::Process(error.to_string()))?;
    let wait = Duration::from_secs_f64(arguments.wait_s);
    let (mut end, session) = ControllerEnd::open(&arguments.bus, wait)?;
    let configuration: Configuration =
        postcard::from_bytes(&session.configuration).map_err(|error| {
            CommandError::Process(format!(
                "the plant on bus {} sent a configuration that cannot be read: {error}",
                arguments.bus
            ))
        })?;
    let image = &arguments.image;
    let mut emulator = Emulator::start(&image.path(), &configuration, image.log)?;
    let mut times = TickTimes::default();
    while let Received::Frame(frame) = end.receive()? {
        let answer = emulator.exchange(&frame)?;
        end.send(&answer.frame)?;
        times.push(&answer);
        if interrupt.is_requested() {
            return Err(CommandError::Interrupted);
        }
    }
    if let Some(path) = &image.timing {
        let report = times.report("qemu", "instructions", &emulator.health()?);
        write(path, &report)?;
    }
    Ok(())
}

fn write(path: &Path, report: &TimingReport) -> Result<(), CommandError> {
    let output = |error: &dyn std::fmt::Display| CommandError::Output(error.to_string());
    let text = serde_json::to_string_pretty(report).map_err(|error| output(&error))?;
    let mut file = AtomicFile::create(path).map_err(|error| output(&error))?;
    writeln!(file, "{text}").map_err(|error| output(&error))?;
    file.commit().map_err(|error| output(&error))
}

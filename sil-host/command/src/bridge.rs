//! `painleve bridge`: the controller's image on a board, joined to the plant's bus.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::{Args, Subcommand};
use painleve_board::emulator::{self, Emulator};
use painleve_board::timing::{TickTimes, TimingReport};
use painleve_board::{BoardError, ConnectedBoard, Drivers, LineHealth, Serial};
use painleve_link::{BusName, ControllerEnd, Pacing, Received};
use painleve_plant::Configuration;
use painleve_shared::message::FrameSource;
use painleve_system::atomic_file::AtomicFile;
use painleve_system::interrupt::Interrupt;
use painleve_system::terminal::warn;

use super::{CommandError, or_interrupted};

/// Options of `painleve bridge`.
#[derive(Debug, Args)]
pub struct BridgeArguments {
    #[command(subcommand)]
    target: BridgeTarget,
}

#[derive(Debug, Subcommand)]
enum BridgeTarget {
    /// The image under QEMU: deterministic, with instruction counts.
    Qemu {
        #[command(flatten)]
        bus: BusArguments,
        #[command(flatten)]
        image: ImageArguments,
    },
    /// The board's sensor drivers in this process, over models of the sensors' chips.
    Drivers {
        #[command(flatten)]
        bus: BusArguments,
        #[command(flatten)]
        lines: SensorLineArguments,
        /// Write what every tick cost as JSON.
        #[arg(long, value_name = "PATH")]
        timing: Option<PathBuf>,
    },
    /// A flashed board behind a serial port.
    Serial {
        #[command(flatten)]
        bus: BusArguments,
        /// The port, as in /dev/ttyUSB0.
        #[arg(long, value_name = "PATH")]
        port: PathBuf,
        /// Write what every tick cost as JSON.
        #[arg(long, value_name = "PATH")]
        timing: Option<PathBuf>,
    },
}

#[derive(Debug, Args)]
struct BusArguments {
    /// Bus on which the plant is.
    #[arg(long)]
    bus: BusName,
    /// How long to wait for the plant, s.
    #[arg(long, value_name = "SECONDS", default_value_t = 1.8, value_parser = super::seconds)]
    wait_s: f64,
    /// What the plant runs, for the report.
    #[arg(long, hide = true, default_value = "")]
    scenario_name: String,
}

/// How the sensors' lines disturb what they carry.
#[derive(Clone, Debug, Default, Args)]
pub struct SensorLineArguments {
    /// With --host drivers: probability that a bit on a sensor line is flipped.
    #[arg(long, value_name = "PROBABILITY", default_value_t = 0.0, value_parser = probability)]
    pub bit_errors: f64,
}

fn probability(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(value) if (0.0..=0.1).contains(&value) => Ok(value),
        _ => Err("give a probability from 0 to 0.1".into()),
    }
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
    pub timing: Option<PathBuf>,
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
    match &arguments.target {
        BridgeTarget::Qemu { bus, image } => {
            carry(bus, image.timing.as_deref(), |configuration, _| {
                Emulator::start(&image.path(), configuration, image.log)
            })
        }
        BridgeTarget::Drivers { bus, lines, timing } => {
            carry(bus, timing.as_deref(), |configuration, _| {
                Drivers::new(configuration, lines.bit_errors)
            })
        }
        BridgeTarget::Serial { bus, port, timing } => {
            carry(bus, timing.as_deref(), |configuration, pacing| {
                Serial::open(port, configuration, frame_source(pacing))
            })
        }
    }
}

/// A board that is to keep time counts the ticks without a frame.
fn frame_source(pacing: Pacing) -> FrameSource {
    match pacing {
        Pacing::Lockstep => FrameSource::Lockstep,
        Pacing::Realtime => FrameSource::Realtime,
    }
}

fn carry<B: ConnectedBoard>(
    bus: &BusArguments,
    timing: Option<&Path>,
    start: impl FnOnce(&Configuration, Pacing) -> Result<B, BoardError>,
) -> Result<(), CommandError> {
    let interrupt = Interrupt::catch()?;
    or_interrupted(carry_until(bus, timing, start, &interrupt), &interrupt)
}

fn carry_until<B: ConnectedBoard>(
    bus: &BusArguments,
    timing: Option<&Path>,
    start: impl FnOnce(&Configuration, Pacing) -> Result<B, BoardError>,
    interrupt: &Interrupt,
) -> Result<(), CommandError> {
    let wait = Duration::from_secs_f64(bus.wait_s);
    let (mut end, session) = ControllerEnd::open(&bus.bus, wait, interrupt)?;
    let configuration: Configuration =
        postcard::from_bytes(&session.configuration).map_err(|error| {
            CommandError::Process(format!(
                "the plant on bus {} sent a configuration that cannot be read: {error}",
                bus.bus
            ))
        })?;
    let mut board = start(&configuration, session.pacing)?;
    let mut times = TickTimes::default();
    while let Received::Frame(frame) = end.receive()? {
        let answer = board.exchange(&frame)?;
        end.send(&answer.frame)?;
        times.push(&answer.frame, answer.cost);
        if interrupt.is_requested() {
            return Err(CommandError::Interrupted);
        }
    }
    if let Some(path) = timing {
        let scenario = &bus.scenario_name;
        let report = TimingReport::of_board(scenario, session.tick_hz, &times, &mut board)?;
        write(path, &report)?;
    }
    if let Some(remark) = board.remark() {
        warn(remark);
    }
    if let Some(line) = board.line()
        && line != LineHealth::default()
    {
        warn(format_args!(
            "line: {} requests repeated, {} runs of garbage and {} wrong checksums from the board",
            line.repeated_requests, line.garbage, line.failed_checksums
        ));
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

//! `painleve bridge`: connects the controller's image on a board to the plant's bus.

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use painleve_board::emulator::{self, Emulator};
use painleve_board::timing::{TickTimes, TimingReport};
use painleve_board::{BoardError, ConnectedBoard, Drivers, LineHealth, Serial};
use painleve_files::atomic_file;
use painleve_link::{Pacing, Received};
use painleve_plant::Configuration;
use painleve_process::interrupt::Interrupt;
use painleve_process::terminal::warn;
use painleve_shared::message::FrameSource;
use serde::{Deserialize, Serialize};

use super::distinct_files;
use super::join::JoinArguments;
use super::output_error::output;
use super::system_path::SystemPath;
use super::{CommandError, or_interrupted};

/// Options of `painleve bridge`.
#[derive(Debug, Args, Serialize, Deserialize)]
pub struct BridgeArguments {
    #[command(subcommand)]
    pub target: BridgeTarget,
}

/// Where the controller runs.
#[derive(Debug, Subcommand, Serialize, Deserialize)]
pub enum BridgeTarget {
    /// Run the image under QEMU: deterministic, with instruction counts.
    Qemu {
        #[command(flatten)]
        bus: BusArguments,
        #[command(flatten)]
        image: ImageArguments,
    },
    /// Run the controller behind the board's sensor drivers, over models of the sensors' chips.
    Drivers {
        #[command(flatten)]
        bus: BusArguments,
        #[command(flatten)]
        lines: SensorLineArguments,
        /// Write the cost of every tick as JSON.
        #[arg(long, value_name = "PATH")]
        timing: Option<SystemPath>,
    },
    /// Use a flashed board behind a serial port.
    Serial {
        #[command(flatten)]
        bus: BusArguments,
        /// Serial port, for example /dev/ttyUSB0.
        #[arg(long, value_name = "PATH")]
        port: SystemPath,
        /// Write the cost of every tick as JSON.
        #[arg(long, value_name = "PATH")]
        timing: Option<SystemPath>,
    },
}

/// The plant to join, and what the report says of it.
#[derive(Debug, Args, Serialize, Deserialize)]
pub struct BusArguments {
    #[command(flatten)]
    pub plant: JoinArguments,
    /// Name of the scenario, which `painleve run` knows.
    #[arg(skip)]
    pub scenario_name: String,
}

/// Disturbances of the sensor lines.
#[derive(Clone, Debug, Default, Args, Serialize, Deserialize)]
pub struct SensorLineArguments {
    /// Probability that a bit on a sensor line of the drivers is flipped.
    #[arg(long, value_name = "PROBABILITY", default_value_t = 0.0, value_parser = probability)]
    pub bit_errors: f64,
}

fn probability(text: &str) -> Result<f64, String> {
    painleve_study_core::options::number(text, 0.0..=0.1, "a probability")
}

/// The image to run, and which of its output to keep.
#[derive(Clone, Debug, Default, Args, Serialize, Deserialize)]
pub struct ImageArguments {
    /// The controller's image; by default the workspace's own build.
    #[arg(long, value_name = "PATH")]
    pub elf: Option<SystemPath>,
    /// Print the image's log; needs `defmt-print`.
    #[arg(long)]
    pub log: bool,
    /// Write the cost of every tick as JSON.
    #[arg(long, value_name = "PATH")]
    pub timing: Option<SystemPath>,
}

impl ImageArguments {
    /// Returns the path of the image.
    pub fn path(&self) -> PathBuf {
        let given = self.elf.as_deref().map(Path::to_path_buf);
        given.unwrap_or_else(emulator::default_image)
    }
}

/// Carries frames between the bus and the board until the plant's session ends.
///
/// # Errors
/// [`CommandError`] if the bus, the board or the output fails, or the user interrupts.
pub fn run(arguments: &BridgeArguments) -> Result<(), CommandError> {
    match &arguments.target {
        BridgeTarget::Qemu { bus, image } => {
            emulator::check(&image.path(), image.log)?;
            carry(bus, image.timing.as_deref(), |configuration, _| {
                Emulator::start(
                    &image.path(),
                    configuration,
                    image.log,
                    bus.plant.patience.board(),
                )
            })
        }
        BridgeTarget::Drivers { bus, lines, timing } => {
            carry(bus, timing.as_deref(), |configuration, _| {
                Drivers::new(configuration, lines.bit_errors)
            })
        }
        BridgeTarget::Serial { bus, port, timing } => {
            carry(bus, timing.as_deref(), |configuration, pacing| {
                let source = frame_source(pacing);
                let patience = bus.plant.patience.board();
                let serial = Serial::open(port, configuration, source, patience)?;
                if let Err(error) = serial.compare_sources() {
                    warn(error);
                }
                Ok(serial)
            })
        }
    }
}

/// Returns the board's source of frames: with real-time pacing it counts ticks without a frame.
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
    if let Some(path) = timing {
        distinct_files::check(&[("--timing", path)])?;
    }
    let interrupt = Interrupt::catch()?;
    or_interrupted(carry_until(bus, timing, start, &interrupt), &interrupt)
}

fn carry_until<B: ConnectedBoard>(
    bus: &BusArguments,
    timing: Option<&Path>,
    start: impl FnOnce(&Configuration, Pacing) -> Result<B, BoardError>,
    interrupt: &Interrupt,
) -> Result<(), CommandError> {
    let (mut end, session, configuration) = bus.plant.join(interrupt)?;
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
            "line: {} requests repeated, {} unreadable byte sequences and {} wrong checksums from the board",
            line.repeated_requests, line.garbage, line.failed_checksums
        ));
    }
    Ok(())
}

fn write(path: &Path, report: &TimingReport) -> Result<(), CommandError> {
    let text = serde_json::to_string_pretty(report).map_err(output)?;
    atomic_file::write(path, format!("{text}\n").as_bytes()).map_err(output)
}

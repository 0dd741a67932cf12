//! The host's side of the controller's image on a microcontroller.
//!
//! - [`drivers`]: the board's sensor drivers on this PC, over models of the sensors' chips
//! - [`emulator`]: the image under QEMU, in deterministic lockstep
//! - [`serial`]: a flashed board behind a serial port
//! - [`arm`]: a flashed board that drives a real arm by its own sensors
//! - [`on_board`]: a board of this process in a closed loop
//! - [`timing`]: the cost of control ticks, on a board or on this machine

pub mod arm;
pub mod drivers;
pub mod emulator;
pub mod on_board;
mod port;
pub mod serial;
mod stored;
pub mod timing;

use std::io;
use std::path::PathBuf;
use std::process::ExitStatus;
use std::time::Duration;

use painleve_plant::Configuration;
use painleve_shared::frame::{ActuatorFrame, SensorFrame};
use painleve_shared::message::{Health, RefusedRate, Response};
use painleve_shared::stored::StoredState;
use painleve_shared::wire::WireError;
use serde::{Deserialize, Serialize};

pub use drivers::Drivers;
pub use emulator::Emulator;
pub use on_board::OnBoard;
pub use port::{Port, SerialPort};
pub use serial::Serial;

use crate::timing::Unit;

/// The answer of a board to one sensor frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TimedAnswer {
    /// The frame.
    pub frame: ActuatorFrame,
    /// Cost of the controller's tick, in the board's unit.
    pub cost: u32,
}

/// Longest silence of a board unless set otherwise. It is shorter than the link's silence limit, so that the error names
/// the board.
pub const SILENCE_LIMIT: Duration = Duration::from_millis(1000);

/// A configured board that answers sensor frames.
pub trait ConnectedBoard {
    /// Name of the host in reports.
    const HOST: &'static str;

    /// Returns the unit of costs.
    fn unit(&self) -> Unit;

    /// Runs one control tick on the board.
    ///
    /// # Errors
    /// [`BoardError`] if the image has stopped, does not answer or gives an invalid answer.
    fn exchange(&mut self, frame: &SensorFrame) -> Result<TimedAnswer, BoardError>;

    /// Returns the board's counters.
    ///
    /// # Errors
    /// As [`ConnectedBoard::exchange`].
    fn health(&mut self) -> Result<Health, BoardError>;

    /// Returns one sentence about disturbances of the run, if there were any.
    fn remark(&self) -> Option<String> {
        None
    }

    /// Returns the counters of the host's end of a line; `None` for a lossless link.
    fn line(&self) -> Option<LineHealth> {
        None
    }
}

/// Counters of the host's end of a serial line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LineHealth {
    /// Requests that were sent again because no answer came.
    pub repeated_requests: u64,
    /// Byte sequences that were not a message.
    pub garbage: u64,
    /// Messages whose checksum was wrong.
    pub failed_checksums: u64,
}

/// Encodes a configuration for a board.
fn encode(configuration: &Configuration) -> Result<Vec<u8>, BoardError> {
    postcard::to_stdvec(configuration).map_err(|_| WireError::BufferTooSmall.into())
}

/// Failure of a board.
#[derive(Debug, thiserror::Error)]
pub enum BoardError {
    /// The image does not exist.
    #[error("no image at {}: build it with `cargo xtask build-fw`, or give its path with --elf", .0.display())]
    ImageMissing(PathBuf),
    /// The file is no program for this processor.
    #[error("{} is not an ELF image for an ARM processor: give the path of one that `cargo xtask build-fw` has built", .0.display())]
    NotAnImage(PathBuf),
    /// The emulator is not installed.
    #[error(
        "qemu-system-arm is not installed: run `cargo xtask setup` or `apt-get install qemu-system-arm`"
    )]
    EmulatorMissing,
    /// The program that decodes the image's log is not installed.
    #[error(
        "defmt-print is not installed: run `cargo install defmt-print --locked`, or leave out --log"
    )]
    LogPrinterMissing,
    /// The serial port cannot be used.
    #[error("cannot use the serial port {}: {source}", path.display())]
    Port {
        /// The port.
        path: PathBuf,
        /// Error of the system.
        source: io::Error,
    },
    /// Another program has opened the serial port.
    #[error(
        "the serial port {} is in use by another program: only one at a time can talk to a board", .0.display()
    )]
    InUse(PathBuf),
    /// The serial port has disappeared.
    #[error(
        "the serial port is gone: the board or its adapter has been unplugged or has lost power"
    )]
    Unplugged,
    /// The serial port has taken no bytes for too long.
    #[error("the board has taken no bytes for {:.1} s: its image or its USB adapter hangs", .0.as_secs_f64())]
    Deaf(Duration),
    /// The emulator has ended on its own.
    #[error(
        "the emulated STM32F405 has stopped ({0}): is the image built for this chip? run --log shows its log"
    )]
    Ended(ExitStatus),
    /// The board has been silent for too long.
    #[error("the board has not answered for {:.1} s: its image hangs or is missing, or this program was suspended", .0.as_secs_f64())]
    Silent(Duration),
    /// What arrives on the serial line are no frames.
    #[error(
        "the board has not answered for {:.1} s: received {bytes} bytes, none of them a frame: wrong baud rate, a noisy \
         line, or not this firmware?",
        lasted.as_secs_f64()
    )]
    NoFrames {
        /// Bytes since the last frame.
        bytes: usize,
        /// Time without a frame.
        lasted: Duration,
    },
    /// The received bytes are not a message.
    #[error(
        "the board's answer cannot be read: {0}; its image may be older than this program, see `cargo xtask build-fw`"
    )]
    Wire(#[from] WireError),
    /// The configuration is out of range for the image.
    #[error(
        "the image refuses the configuration: it may be older than this program, see `cargo xtask build-fw`; or `painleve accept` has not reset the board, which then drives no arm until a reset"
    )]
    Refused,
    /// The board's watchdogs have no limit for the control rate.
    #[error(
        "run.tick_hz = {}: the board refuses this control rate, because no limit of its window watchdog lies between one tick and two; {}",
        .0.tick_hz,
        other_rates(.0)
    )]
    RateRefused(RefusedRate),
    /// Image and program speak different protocols.
    #[error(
        "the image speaks protocol {board} and this program protocol {host}: build both from the same sources, see `cargo xtask build-fw`, and flash again"
    )]
    OtherProtocol {
        /// The image's protocol.
        board: u16,
        /// This program's protocol.
        host: u16,
    },
    /// The board has not stored its configuration.
    #[error("stored state {}: {}", .0.code(), .0.text())]
    NotStored(StoredState),
    /// Messages or settings of image and program differ.
    #[error(
        "the image is of build {board:016x} and this program of build {host:016x}: build both from the same sources, see `cargo xtask build-fw`, and flash again"
    )]
    OtherBuild {
        /// The image's build.
        board: u64,
        /// This program's build.
        host: u64,
    },
    /// Image and program understand each other, but their controllers were built from different sources.
    #[error(
        "the image is of sources {board:016x} and this program of sources {host:016x}: its controller may behave differently; see `cargo xtask build-fw`"
    )]
    OtherSources {
        /// Hash of the image's sources.
        board: u64,
        /// Hash of this program's sources.
        host: u64,
    },
    /// The board's parts cannot give the requested counts.
    #[error("{key} = {wanted}: the board's part has only {has} bits")]
    Parts {
        /// Key of the setting.
        key: &'static str,
        /// Its value.
        wanted: u8,
        /// Bits of the part.
        has: u8,
    },
    /// The message does not answer the request.
    #[error("unexpected answer from the board: {0:?}")]
    OutOfTurn(Response),
    /// A pipe or a process failed.
    #[error("cannot talk to the board: {0}")]
    System(#[from] io::Error),
}

/// Says which control rates a board accepts instead.
fn other_rates(refused: &RefusedRate) -> String {
    match [refused.below_hz, refused.above_hz] {
        [0, 0] => "there is none for this board".into(),
        [hz, 0] | [0, hz] => format!("it accepts, for example, {hz} Hz"),
        [below, above] => format!("it accepts, for example, {below} and {above} Hz"),
    }
}

impl BoardError {
    /// Returns the error for an image of another build.
    fn other_build(board: u64) -> Self {
        Self::OtherBuild {
            board,
            host: painleve_plant::law_choice::build(),
        }
    }

    /// Compares the hash of the image's sources with this program's.
    fn compare_sources(board: u64) -> Result<(), Self> {
        let host = painleve_firmware::SOURCES;
        if board == host {
            Ok(())
        } else {
            Err(Self::OtherSources { board, host })
        }
    }
}

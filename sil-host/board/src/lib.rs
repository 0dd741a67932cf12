//! The controller's image on a microcontroller, as the host talks to it.
//!
//! - [`drivers`]: no board, but its sensor drivers on this PC, over models of the chips
//! - [`emulator`]: the image under QEMU, in deterministic lockstep
//! - [`serial`]: a flashed board behind a serial port
//! - [`log`]: what the image says, decoded with its own table
//! - [`on_board`]: a board of this process in a closed loop
//! - [`timing`]: what control ticks cost, on a board or on this machine

pub mod drivers;
pub mod emulator;
pub mod log;
pub mod on_board;
pub mod serial;
pub mod timing;

use std::io;
use std::path::PathBuf;
use std::process::ExitStatus;
use std::time::Duration;

use painleve_plant::Configuration;
use painleve_shared::frame::{ActuatorFrame, SensorFrame};
use painleve_shared::message::{Health, Response};
use painleve_shared::wire::WireError;
use serde::{Deserialize, Serialize};

pub use drivers::Drivers;
pub use emulator::Emulator;
pub use on_board::OnBoard;
pub use serial::Serial;

use crate::timing::Unit;

/// The answer of a board to one sensor frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TimedAnswer {
    /// The frame.
    pub frame: ActuatorFrame,
    /// What the controller's tick took, in [`ConnectedBoard::unit`].
    pub cost: u32,
}

/// A board silent for longer than this hangs; shorter than the link's own limit, so that
/// the message that is seen is about the board.
const SILENCE_LIMIT: Duration = Duration::from_millis(1000);

/// A board that has its configuration and answers sensor frames.
pub trait ConnectedBoard {
    /// What reports call it.
    const HOST: &'static str;

    /// What costs are counted in.
    fn unit(&self) -> Unit;

    /// Lets the image control one tick.
    ///
    /// # Errors
    /// [`BoardError`] if the image has stopped, hangs or answers wrongly.
    fn exchange(&mut self, frame: &SensorFrame) -> Result<TimedAnswer, BoardError>;

    /// What the image has counted.
    ///
    /// # Errors
    /// As [`ConnectedBoard::exchange`].
    fn health(&mut self) -> Result<Health, BoardError>;

    /// One sentence about what disturbed the run, if anything did.
    fn remark(&self) -> Option<String> {
        None
    }

    /// What the host's end of a line has counted; `None` for a link that loses nothing.
    fn line(&self) -> Option<LineHealth> {
        None
    }
}

/// What the host's end of a serial line has counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LineHealth {
    /// Requests that were sent again because no answer came.
    pub repeated_requests: u64,
    /// Runs of bytes that were no message.
    pub garbage: u64,
    /// Messages whose checksum was wrong.
    pub failed_checksums: u64,
}

/// A configuration as boards get it.
fn encode(configuration: &Configuration) -> Result<Vec<u8>, BoardError> {
    postcard::to_stdvec(configuration).map_err(|_| WireError::BufferTooSmall.into())
}

/// Why a board does not answer.
#[derive(Debug, thiserror::Error)]
pub enum BoardError {
    /// There is no image.
    #[error("no image at {}: build it with `cargo xtask build-fw`, or name one with --elf", .0.display())]
    ImageMissing(PathBuf),
    /// The image cannot be read.
    #[error("cannot use the image {}: {reason}", path.display())]
    Image {
        /// The image.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// There is no emulator.
    #[error(
        "qemu-system-arm is not installed: `cargo xtask setup`, or `apt-get install qemu-system-arm`"
    )]
    EmulatorMissing,
    /// The serial port cannot be used.
    #[error("cannot use the serial port {}: {source}", path.display())]
    Port {
        /// The port.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// The emulator has ended by itself.
    #[error("the emulated board has stopped ({0}): run with --log to see what its image says")]
    Ended(ExitStatus),
    /// Nothing has come for too long.
    #[error("the board has not answered for {0:.1?}: its image hangs, or is not there")]
    Silent(Duration),
    /// What has come is no message.
    #[error(
        "the board's answer cannot be read: {0}; its image may be older than this program, see `cargo xtask build-fw`"
    )]
    Wire(#[from] WireError),
    /// The configuration is out of range for the image.
    #[error(
        "the image refuses the configuration: it may be older than this program, see `cargo xtask build-fw`"
    )]
    Refused,
    /// Image and program come from different sources.
    #[error(
        "the image is of build {board:016x} and this program of build {host:016x}: build both from the same sources, see `cargo xtask build-fw`, and flash again"
    )]
    OtherBuild {
        /// The image's build.
        board: u64,
        /// This program's build.
        host: u64,
    },
    /// The board's parts cannot give the counts that are asked for.
    #[error("{key} = {wanted}: the board's part has {has} bits")]
    Parts {
        /// The setting.
        key: &'static str,
        /// Its value.
        wanted: u8,
        /// What the part has.
        has: u8,
    },
    /// A message that does not answer what was asked.
    #[error("the board answered out of turn with {0:?}")]
    OutOfTurn(Response),
    /// Pipes or processes fail.
    #[error("cannot talk to the board: {0}")]
    System(#[from] io::Error),
}

impl BoardError {
    /// The image is of this build.
    fn other_build(board: u64) -> Self {
        Self::OtherBuild {
            board,
            host: painleve_firmware::BUILD,
        }
    }
}

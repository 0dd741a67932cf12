//! The controller's image on a microcontroller, as the host talks to it.
//!
//! - [`emulator`]: the image under QEMU, in deterministic lockstep
//! - [`log`]: what the image says, decoded with its own table
//! - [`tick_times`]: what its ticks cost

pub mod emulator;
pub mod log;
pub mod tick_times;

use std::io;
use std::path::PathBuf;
use std::process::ExitStatus;
use std::time::Duration;

use painleve_shared::frame::ActuatorFrame;
use painleve_shared::message::Response;
use painleve_shared::wire::WireError;

pub use emulator::Emulator;
pub use tick_times::{TickTimes, TimingReport};

/// The answer of a board to one sensor frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TimedAnswer {
    /// The frame.
    pub frame: ActuatorFrame,
    /// Instructions that the controller's tick took.
    pub instructions: u32,
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
    /// The emulator has ended by itself.
    #[error("the emulated board has stopped ({0}): run with --log to see what its image says")]
    Ended(ExitStatus),
    /// Nothing has come for too long.
    #[error("the emulated board has not answered for {0:.1?}: its image hangs")]
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
    /// A message that does not answer what was asked.
    #[error("the board answered out of turn with {0:?}")]
    OutOfTurn(Response),
    /// Pipes or processes fail.
    #[error("cannot talk to the emulated board: {0}")]
    System(#[from] io::Error),
}

//! What can go wrong on the link, said to the person at the terminal.

use std::path::PathBuf;
use std::time::Duration;

use thiserror::Error;

use super::{BusName, CONFIGURATION_CAPACITY};

/// A failure of the link; the message names the bus and what to do.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum LinkError {
    /// A name that cannot be a bus.
    #[error(
        "bus name {name:?} is not allowed: use 1 to 64 characters of A-Z, a-z, 0-9, '_' and '-'"
    )]
    InvalidBusName {
        /// The rejected name.
        name: String,
    },

    /// Another plant is alive on the bus.
    #[error("bus `{bus}` already has a plant: choose another name with --bus, or end that plant")]
    BusInUse {
        /// The bus.
        bus: BusName,
    },

    /// The services of an earlier plant are still held by its controller.
    #[error(
        "bus `{bus}` is still held by a process of an earlier run: \
         end that process, or choose another name with --bus"
    )]
    BusOccupied {
        /// The bus.
        bus: BusName,
    },

    /// Another controller is alive on the bus.
    #[error(
        "bus `{bus}` already has a controller: end that controller, or choose another bus with --bus"
    )]
    ControllerInUse {
        /// The bus.
        bus: BusName,
    },

    /// No plant came up in time.
    #[error("no plant on bus `{bus}` after {waited:.1?}: start `painleve plant --bus {bus}`")]
    PlantMissing {
        /// The bus.
        bus: BusName,
        /// How long was waited.
        waited: Duration,
    },

    /// No controller came up in time.
    #[error(
        "no controller on bus `{bus}` after {waited:.1?}: start `painleve controller --bus {bus}`"
    )]
    ControllerMissing {
        /// The bus.
        bus: BusName,
        /// How long was waited.
        waited: Duration,
    },

    /// The plant's process ended or was killed before the session's end.
    #[error("the plant on bus `{bus}` is gone: it failed or was killed before the end of the run")]
    PlantGone {
        /// The bus.
        bus: BusName,
    },

    /// The controller's process ended or was killed before the session's end.
    #[error(
        "the controller on bus `{bus}` is gone: it failed or was killed before the end of the run"
    )]
    ControllerGone {
        /// The bus.
        bus: BusName,
    },

    /// The plant's process lives but sends nothing.
    #[error("the plant on bus `{bus}` has sent nothing for {silence:.1?}: it is stopped or stuck")]
    PlantSilent {
        /// The bus.
        bus: BusName,
        /// How long it has been silent.
        silence: Duration,
    },

    /// The controller's process lives but does not answer.
    #[error(
        "the controller on bus `{bus}` has not answered for {silence:.1?}: it is stopped or stuck"
    )]
    ControllerSilent {
        /// The bus.
        bus: BusName,
        /// How long it has been silent.
        silence: Duration,
    },

    /// The controller answered another tick than the one asked for.
    #[error("the controller on bus `{bus}` answered tick {answered} when asked for tick {asked}")]
    WrongTick {
        /// The bus.
        bus: BusName,
        /// Tick of the sensor frame.
        asked: u32,
        /// Tick the answer echoes.
        answered: u32,
    },

    /// The configuration does not fit the session message.
    #[error(
        "the configuration takes {length} bytes; at most {CONFIGURATION_CAPACITY} fit the link"
    )]
    ConfigurationTooLong {
        /// Its length in bytes.
        length: usize,
    },

    /// The peer speaks another version of the frames or the session message.
    #[error("bus `{bus}` is used by another version of painleve: use the same build for both ends")]
    Incompatible {
        /// The bus.
        bus: BusName,
    },

    /// The folder of a bus cannot be used.
    #[error(
        "cannot keep a bus in `{folder}`: {reason}; \
         set XDG_RUNTIME_DIR to a folder that only you can write to"
    )]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// Why not.
        reason: String,
    },

    /// A process keeps the folder of the bus locked.
    #[error("bus `{bus}` is held by {}, which is stopped or stuck: end it", holder(*process))]
    Held {
        /// The bus.
        bus: BusName,
        /// The process, if it is known.
        process: Option<u32>,
    },

    /// There is too little shared memory for a bus.
    #[error(
        "bus `{bus}`: {folder} has {available} bytes left, a bus needs {needed}: \
         make it larger, or remove what `painleve doctor` names"
    )]
    SharedMemoryFull {
        /// The bus.
        bus: BusName,
        /// Where shared memory is.
        folder: &'static str,
        /// Bytes that can be taken.
        available: u64,
        /// Bytes that are needed.
        needed: u64,
    },

    /// Ctrl-C or a request to end, while waiting for the peer.
    #[error("interrupted")]
    Interrupted,

    /// iceoryx2 or the operating system refused.
    #[error(
        "bus `{bus}`: could not {action} ({cause}); \
         check that /dev/shm is writable and not full, and `ulimit -n`"
    )]
    Transport {
        /// The bus.
        bus: BusName,
        /// What was tried.
        action: &'static str,
        /// iceoryx2's reason.
        cause: String,
    },
}

fn holder(process: Option<u32>) -> String {
    process.map_or_else(
        || "a process".into(),
        |process| format!("process {process}"),
    )
}

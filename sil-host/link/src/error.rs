//! Errors of the link, worded for the user at the terminal.

use std::error::Error;
use std::io;
use std::path::PathBuf;
use std::time::Duration;

use painleve_process::refusal::remedy;

use super::bus::BusName;
use super::session::ConfigurationTooLong;

/// A failure of the link. The message names the bus and the remedy.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LinkError {
    /// Another plant is alive on the bus.
    #[error("bus `{bus}` already has a plant: choose another name with --bus, or end that plant")]
    BusInUse {
        /// The bus.
        bus: BusName,
    },

    /// A process of an earlier run, normally its controller, still holds the
    /// bus.
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

    /// No plant appeared in time.
    #[error("no plant on bus `{bus}` after {:.1} s: start `painleve plant --bus {bus}`", .waited.as_secs_f64())]
    PlantMissing {
        /// The bus.
        bus: BusName,
        /// Time waited.
        waited: Duration,
    },

    /// No controller appeared in time.
    #[error("no controller on bus `{bus}` after {:.1} s: start `painleve controller --bus {bus}`", .waited.as_secs_f64())]
    ControllerMissing {
        /// The bus.
        bus: BusName,
        /// Time waited.
        waited: Duration,
    },

    /// The plant's process ended or was killed before the end of the session.
    #[error("the plant on bus `{bus}` is gone: it failed or was killed before the end of the run")]
    PlantGone {
        /// The bus.
        bus: BusName,
    },

    /// The controller's process ended or was killed before the end of the
    /// session.
    #[error(
        "the controller on bus `{bus}` is gone: it failed or was killed before the end of the run"
    )]
    ControllerGone {
        /// The bus.
        bus: BusName,
    },

    /// The plant's process is alive but sends nothing.
    #[error("the plant on bus `{bus}` has sent nothing for {:.1} s: it is stopped or stuck", .silence.as_secs_f64())]
    PlantSilent {
        /// The bus.
        bus: BusName,
        /// Duration of the silence.
        silence: Duration,
    },

    /// The controller's process is alive but does not answer.
    #[error("the controller on bus `{bus}` has not answered for {:.1} s: it is stopped or stuck", .silence.as_secs_f64())]
    ControllerSilent {
        /// The bus.
        bus: BusName,
        /// Duration of the silence.
        silence: Duration,
    },

    /// The controller answered a different tick from the one requested.
    #[error("the controller on bus `{bus}` answered tick {answered} when asked for tick {asked}")]
    WrongTick {
        /// The bus.
        bus: BusName,
        /// Tick of the sensor frame.
        asked: u32,
        /// Tick that the answer echoes.
        answered: u32,
    },

    /// The configuration does not fit the session message.
    #[error(transparent)]
    ConfigurationTooLong(#[from] ConfigurationTooLong),

    /// The peer uses another version of the frames or of the session message.
    #[error("bus `{bus}` is used by another version of painleve: use the same build for both ends")]
    Incompatible {
        /// The bus.
        bus: BusName,
    },

    /// The folder of a bus cannot be used.
    #[error(
        "cannot use `{folder}` for a bus: {source}{}",
        remedy(source, "; set XDG_RUNTIME_DIR to a folder that only you can write to")
    )]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// The reason.
        source: FolderError,
    },

    /// Another process keeps the folder of the bus locked.
    #[error("bus `{bus}` is held by {}, which is stopped or stuck: end it", holder(*process))]
    Held {
        /// The bus.
        bus: BusName,
        /// Id of the process, if known.
        process: Option<u32>,
    },

    /// There is too little shared memory for a bus.
    #[error(
        "bus `{bus}`: {folder} has {available} bytes free, but a bus needs {needed}: \
         enlarge it, or remove the files that `painleve doctor` lists"
    )]
    SharedMemoryFull {
        /// The bus.
        bus: BusName,
        /// Folder of the shared memory.
        folder: &'static str,
        /// Free bytes.
        available: u64,
        /// Required bytes.
        needed: u64,
    },

    /// The user pressed Ctrl-C or the process was asked to end while it waited
    /// for the peer.
    #[error("interrupted")]
    Interrupted,

    /// iceoryx2 or the operating system reported an error.
    #[error(
        "bus `{bus}`: could not {action} ({source}){}",
        remedy(&**source, "; check that /dev/shm is writable, and `ulimit -a`")
    )]
    Transport {
        /// The bus.
        bus: BusName,
        /// Attempted action.
        action: &'static str,
        /// The error of iceoryx2 or of the system.
        source: Box<dyn Error + Send + Sync>,
    },
}

/// Why a folder cannot be used for a bus.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    /// The system refuses access to it.
    #[error("{0}")]
    System(#[from] io::Error),
    /// It is not a folder.
    #[error("it is not a folder")]
    NotAFolder,
    /// It belongs to another user.
    #[error("it belongs to user {0}")]
    Foreign(u32),
    /// The paths of files below it would be refused by iceoryx2.
    #[error("its path is too long or not ASCII")]
    UnusablePath,
}

fn holder(process: Option<u32>) -> String {
    process.map_or_else(
        || "a process".into(),
        |process| format!("process {process}"),
    )
}

//! Failures of the processes of a run.

use std::path::PathBuf;
use std::process::ExitStatus;

use painleve_link::{BusName, UnreadableConfiguration};
use painleve_process::refusal::remedy;
use painleve_shared::range::OutOfRange;

/// Failure of a process, or of a message to it.
#[derive(Debug, thiserror::Error)]
pub enum ProcessError {
    /// The operating system refuses something outside files and links.
    #[error("{}{}", .0, remedy(.0, ""))]
    System(#[from] std::io::Error),
    /// A process cannot be started.
    #[error("cannot start {}: {source}{}", program.display(), remedy(source, ""))]
    Start {
        /// The program.
        program: PathBuf,
        /// The reason.
        source: std::io::Error,
    },
    /// A thread that reads the output of a process cannot be started.
    #[error("cannot start a thread: {}{}", .0, remedy(.0, ""))]
    Thread(std::io::Error),
    /// The threads of a study cannot be started.
    #[error("cannot start threads: {}{}", .0, remedy(.0, ""))]
    Threads(#[from] rayon::ThreadPoolBuildError),
    /// A process ended before its run.
    #[error("the {process} process ended early ({status}){complaint}")]
    EndedEarly {
        /// Its part in the run.
        process: &'static str,
        /// How it ended.
        status: ExitStatus,
        /// A colon and its last words; empty without any.
        complaint: String,
    },
    /// The controller failed at the end of the run.
    #[error("the controller process failed ({status}){complaint}")]
    Failed {
        /// How it ended.
        status: ExitStatus,
        /// A colon and its last words; empty without any.
        complaint: String,
    },
    /// The controller still ran after its plant had ended.
    #[error("the controller process did not end with its plant")]
    Outlived,
    /// A process was stopped for too long.
    #[error("the {process} process ({id}) was stopped and has been killed")]
    Stopped {
        /// Its part in the run.
        process: &'static str,
        /// Its process id.
        id: u32,
    },
    /// A process failed and printed this.
    #[error("{0}")]
    Reported(String),
    /// The plant's output is not a report.
    #[error("the plant process gave no report: {0}")]
    NoReport(serde_json::Error),
    /// A configuration cannot be sent.
    #[error("the configuration cannot be encoded: {0}")]
    Unsendable(postcard::Error),
    /// A configuration cannot be decoded.
    #[error("the plant on bus {bus} sent a configuration that cannot be read: {source}")]
    Unreadable {
        /// The bus.
        bus: BusName,
        /// The reason.
        source: UnreadableConfiguration,
    },
    /// A configuration is out of range.
    #[error("the plant on bus {bus} sent a configuration that this controller refuses: {source}")]
    Refused {
        /// The bus.
        bus: BusName,
        /// The setting and its range.
        source: OutOfRange,
    },
    /// A board answers with a state or a fault of another version.
    #[error(
        "the board answers with state {state} and fault {fault}, at least one of which is unknown to \
         this version"
    )]
    NotUnderstood {
        /// Number of its supervisor's state.
        state: u8,
        /// Number of its fault, 0 for none.
        fault: u8,
    },
}

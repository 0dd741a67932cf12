//! Outputs that cannot be written, and inputs that cannot be used.

use std::io;
use std::path::PathBuf;

use painleve_commission::simulated::SimulatedError;
use painleve_record::export::ExportError;
use painleve_record::recorder::RecordError;
use painleve_system::atomic_file::AtomicFileError;
use painleve_system::picture::PictureError;

use super::CommandError;

/// An output cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// A file.
    #[error(transparent)]
    File(#[from] AtomicFileError),
    /// A figure.
    #[error(transparent)]
    Picture(#[from] PictureError),
    /// The record of a run.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// JSON.
    #[error(transparent)]
    Json(#[from] serde_json::Error),
    /// CSV.
    #[error(transparent)]
    Csv(#[from] csv::Error),
    /// Columns of a table.
    #[cfg(feature = "parquet")]
    #[error(transparent)]
    Columns(#[from] painleve_study::sweep::parquet::ColumnsError),
    /// A part of a file.
    #[error(transparent)]
    Write(#[from] io::Error),
    /// Files in a folder.
    #[error("cannot write to {}: {source}", folder.display())]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// The reason.
        source: io::Error,
    },
    /// Standard output.
    #[error("cannot write to stdout: {0}")]
    StandardOutput(io::Error),
}

/// Returns the command's error for an output.
pub fn output(error: impl Into<OutputError>) -> CommandError {
    CommandError::Output(error.into())
}

/// A record cannot be exported.
#[derive(Debug, thiserror::Error)]
pub enum RecordFileError {
    /// The file cannot be read.
    #[error(transparent)]
    Read(#[from] io::Error),
    /// Its content cannot be used.
    #[error(transparent)]
    Content(#[from] ExportError),
}

/// A file or option cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum InputError {
    /// A record cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Record {
        /// The record.
        path: PathBuf,
        /// The reason.
        source: RecordFileError,
    },
    /// The rehearsed arm cannot be simulated.
    #[error(transparent)]
    Rehearsal(#[from] SimulatedError),
    /// This build has no Parquet.
    #[error(
        "this build writes no Parquet: build it with `cargo build --release --features parquet`"
    )]
    NoParquet,
    /// `--live` together with another host.
    #[error("--live runs the controller in this process: leave out --host")]
    LiveHost,
    /// The port of `--live` cannot be opened.
    #[error(
        "cannot serve on port {port} of this machine: {source}; choose another with --live PORT"
    )]
    Port {
        /// The port.
        port: u16,
        /// The reason.
        source: io::Error,
    },
}

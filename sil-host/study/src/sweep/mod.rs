//! Sweeps larger than one machine: the rows of a study in shards, computed under any scheduler.
//!
//! A *campaign* is a study with its options. A *sweep* is a campaign divided into shards, in a
//! folder of its own:
//!
//! - [`campaign`]: the campaign file
//! - [`manifest`]: the exact computation, and the program that performs it
//! - [`share`]: the rows of a shard, and the shard of this process
//! - [`shard_file`]: a finished shard, either complete or absent
//! - [`folder`]: the finished shards, and their merge
//! - `parquet`: the merged rows as columns, with the feature of that name
//! - [`array`]: lists of shards in the syntax of schedulers; [`slurm`]: a job script for Slurm
//!
//! The files are the only state, and no process waits for another.

pub mod array;
pub mod campaign;
pub mod folder;
pub mod manifest;
#[cfg(feature = "parquet")]
pub mod parquet;
pub mod shard_file;
pub mod share;
pub mod slurm;

use std::path::PathBuf;

use painleve_system::atomic_file::AtomicFileError;

use crate::StudyError;

/// Why a sweep cannot be planned, run or merged.
#[derive(Debug, thiserror::Error)]
pub enum SweepError {
    /// A file of the sweep cannot be read.
    #[error("cannot read {what} {}: {source}", path.display())]
    Unreadable {
        /// The kind of file.
        what: &'static str,
        /// The file.
        path: PathBuf,
        /// The reason.
        source: std::io::Error,
    },
    /// The campaign file is invalid.
    #[error("campaign file {}: {message}", path.display())]
    Campaign {
        /// The file.
        path: PathBuf,
        /// The error and the allowed values.
        message: String,
    },
    /// The manifest is invalid, or belongs to another program.
    #[error("manifest {}: {message}", path.display())]
    Manifest {
        /// The file.
        path: PathBuf,
        /// The error and how to correct it.
        message: String,
    },
    /// No shard is given, or it does not exist.
    #[error("{0}")]
    Shard(String),
    /// A shard is missing, duplicated or broken.
    #[error("{0}")]
    Incomplete(String),
    /// The study is invalid or has no outcome.
    #[error(transparent)]
    Study(#[from] StudyError),
    /// A file cannot be written.
    #[error(transparent)]
    Output(#[from] AtomicFileError),
}

impl SweepError {
    /// Returns the error for a file that cannot be read.
    pub fn unreadable(
        what: &'static str,
        path: impl Into<PathBuf>,
        source: std::io::Error,
    ) -> Self {
        Self::Unreadable {
            what,
            path: path.into(),
            source,
        }
    }
}

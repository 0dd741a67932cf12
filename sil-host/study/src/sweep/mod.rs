//! Sweeps that outgrow a machine: a study's rows in shards, computed by any scheduler.
//!
//! A *campaign* is a study and its options, a *sweep* a campaign dealt out into shards, in a
//! folder of its own:
//!
//! - [`campaign`]: the campaign file
//! - [`manifest`]: what exactly is computed, and by which program
//! - [`share`]: which rows are a shard's, and which shard is this process's
//! - [`shard_file`]: a finished shard, complete or not there
//! - [`folder`]: which shards are finished, and putting them together
//! - `parquet`: the merged rows as columns, with the feature of that name
//! - [`array`]: lists of shards as schedulers read them; [`slurm`]: a script for Slurm
//!
//! There is no state but the files, and no process that waits for another.

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

/// Why there is no sweep, or not all of one.
#[derive(Debug, thiserror::Error)]
pub enum SweepError {
    /// A file of the sweep cannot be read.
    #[error("cannot read {what} {}: {source}", path.display())]
    Unreadable {
        /// What it should be.
        what: &'static str,
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The campaign file is wrong.
    #[error("campaign file {}: {message}", path.display())]
    Campaign {
        /// The file.
        path: PathBuf,
        /// What is wrong and what is allowed.
        message: String,
    },
    /// The manifest is wrong, or another program's.
    #[error("manifest {}: {message}", path.display())]
    Manifest {
        /// The file.
        path: PathBuf,
        /// What is wrong and what to do.
        message: String,
    },
    /// There is no such shard.
    #[error("{0}")]
    Shard(String),
    /// The shards are not all there, once each.
    #[error("{0}")]
    Incomplete(String),
    /// The study is wrong or has no outcome.
    #[error(transparent)]
    Study(#[from] StudyError),
    /// A file cannot be written.
    #[error(transparent)]
    Output(#[from] AtomicFileError),
}

impl SweepError {
    /// The file that cannot be read.
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

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
//! - [`mod@array`]: lists of shards in the syntax of schedulers; [`slurm`]: a job script for Slurm
//!
//! The files are the only state, and no process waits for another.

pub mod array;
pub mod campaign;
pub mod folder;
pub mod manifest;
pub mod shard_file;
pub mod share;
pub mod slurm;

use std::path::PathBuf;

use painleve_files::atomic_file::AtomicFileError;

use painleve_study_core::StudyError;

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
    #[error("campaign file {}: {source}", path.display())]
    Campaign {
        /// The file.
        path: PathBuf,
        /// The error and the allowed values.
        source: campaign::CampaignError,
    },
    /// The manifest is invalid, or belongs to another program.
    #[error("manifest {}: {source}", path.display())]
    Manifest {
        /// The file.
        path: PathBuf,
        /// The error and how to correct it.
        source: manifest::ManifestError,
    },
    /// No shard is given, or it does not exist.
    #[error(transparent)]
    Shard(#[from] ShardError),
    /// A shard is missing, duplicated or broken.
    #[error("{} cannot be merged: {}", folder.display(), status.defects().join("; "))]
    Incomplete {
        /// The folder of the sweep.
        folder: PathBuf,
        /// What is missing, duplicated or broken.
        status: Box<folder::SweepStatus>,
    },
    /// The script for a scheduler cannot be written.
    #[error(transparent)]
    Script(#[from] slurm::ScriptError),
    /// The shards do not make one table.
    #[error(transparent)]
    Mismatch(#[from] MismatchError),
    /// The study is invalid or has no outcome.
    #[error(transparent)]
    Study(#[from] StudyError),
    /// A file cannot be written.
    #[error(transparent)]
    Output(#[from] AtomicFileError),
}

/// A shard or a number of shards that does not exist.
#[derive(Debug, thiserror::Error)]
pub enum ShardError {
    /// A number of shards that the study cannot have.
    #[error("--shards {shards}: give 1 to {most} for {rows} rows")]
    Count {
        /// The requested number.
        shards: usize,
        /// The largest number.
        most: usize,
        /// Rows of the study.
        rows: usize,
    },
    /// Another number of shards than the sweep has.
    #[error("--shard: this sweep has {shards} shards, not {given}; give K/{shards}")]
    OtherCount {
        /// Shards of the sweep.
        shards: usize,
        /// The given number.
        given: usize,
    },
    /// A shard beyond the last.
    #[error(
        "{origin}: shard {shard} does not exist; the {shards} shards are numbered 0 to {}",
        shards - 1
    )]
    Beyond {
        /// The option or environment variable that gives the shard.
        origin: String,
        /// The shard.
        shard: usize,
        /// Shards of the sweep.
        shards: usize,
    },
    /// Neither an option nor a scheduler gives a shard.
    #[error(
        "no shard is given; give --shard K/N or --all, or run under a scheduler that sets {}",
        variables.join(", ")
    )]
    NotGiven {
        /// Environment variables that schedulers set.
        variables: &'static [&'static str],
    },
    /// A scheduler's variable that is not a number.
    #[error("{name}={value} is not a shard number; give --shard K/N")]
    NotANumber {
        /// The variable.
        name: &'static str,
        /// Its value.
        value: String,
    },
}

/// Shards that do not make one table.
#[derive(Debug, thiserror::Error)]
pub enum MismatchError {
    /// There are none.
    #[error("the folder holds no shards")]
    None,
    /// Their headers differ.
    #[error("the headers of the shards differ")]
    Headers,
    /// A row is missing or present twice.
    #[error("the shards do not hold every row exactly once")]
    Rows,
    /// They cannot be written as one CSV file.
    #[error(transparent)]
    Csv(#[from] csv::Error),
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

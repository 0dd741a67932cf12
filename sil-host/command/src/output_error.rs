//! Outputs that cannot be written, and inputs that cannot be used.

use std::io;
use std::path::{Path, PathBuf};

use painleve_chart::picture::PictureError;
use painleve_commission::simulated::SimulatedError;
use painleve_files::atomic_file::AtomicFileError;
use painleve_files::input_file;
use painleve_record::comparison::NoEvent;
use painleve_record::export::ExportError;
use painleve_record::recorder::RecordError;
use painleve_record::run_table::TableError;

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
    /// A part of a file.
    #[error(transparent)]
    Write(#[from] io::Error),
    /// A temporary file.
    #[error(
        "cannot write a temporary file in {}: {}; set TMPDIR to a folder that can be written",
        std::env::temp_dir().display(), .0
    )]
    Temporary(io::Error),
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
    /// It is something else.
    #[error("it is no record, as `painleve run` writes")]
    NoRecord,
    /// It has no settings.
    #[error("it has no settings of a run: this is not a record of painleve")]
    NoSettings,
    /// It is no table of ticks.
    #[error(transparent)]
    Table(#[from] TableError),
}

/// A file or option cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum InputError {
    /// No key of a scenario contains a text.
    #[error("--keys {0}: no key contains this; `painleve scenarios --keys` lists all")]
    NoKey(String),
    /// A file has no planar two-link arm.
    #[error("{}: {reason}", path.display())]
    Arm {
        /// The file.
        path: PathBuf,
        /// The reason.
        reason: String,
    },
    /// A recorded slide cannot be used.
    #[error("--slide {}: {reason}", path.display())]
    Slide {
        /// The file.
        path: PathBuf,
        /// The reason.
        reason: String,
    },
    /// Two outputs would replace each other.
    #[error("{} and {} both name `{}`: choose different files", options[0], options[1], path.display())]
    SameFile {
        /// The options that name them.
        options: [String; 2],
        /// The path.
        path: PathBuf,
    },
    /// An output would replace an input.
    #[error(
        "{option} would replace `{}`, which this command reads{}: choose another file",
        input.display(), also(path, input)
    )]
    ReplacesInput {
        /// The option of the output.
        option: String,
        /// Its path.
        path: PathBuf,
        /// The path of the input.
        input: PathBuf,
    },
    /// The first run of a comparison has no settings.
    #[error(
        "the first run must be a record (.mcap), whose settings the page needs: {} has none",
        path.display()
    )]
    FirstWithoutSettings {
        /// The file.
        path: PathBuf,
    },
    /// A run of a comparison lacks the event.
    #[error(transparent)]
    NoEvent(NoEvent),
    /// A table of trials is not of this search.
    #[error(
        "{} is not a table of this search: {reason}; choose another --table, or delete it",
        path.display()
    )]
    OtherSearch {
        /// The file.
        path: PathBuf,
        /// What shows it.
        reason: String,
    },
    /// A key of a search is given twice.
    #[error("--key {key} is given twice: give each key once, with its whole range")]
    RepeatedKey {
        /// The key.
        key: String,
    },
    /// An option is meant for other hosts.
    #[error("{option} has no effect with --host {host}, only with {hosts}: leave it out")]
    WithoutEffect {
        /// The option.
        option: &'static str,
        /// The chosen host.
        host: String,
        /// The hosts with which it has an effect.
        hosts: String,
    },
    /// An option lacks what it is about.
    #[error("{option} has no effect without {needed}: leave it out, or add that")]
    Needs {
        /// The option.
        option: &'static str,
        /// What it needs.
        needed: &'static str,
    },
    /// A setting of an arm that the controller does not use.
    #[error("--set {0} has no effect on a real arm: its controller uses arm_model, so set that")]
    OfSimulatedArm(String),
    /// Standard input cannot be read.
    #[error("cannot read standard input: {0}")]
    StandardInput(io::Error),
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
    /// A scenario of a simulated arm for a real one.
    #[error(
        "this scenario describes a simulated arm (knowledge.source: {0}): start from the file of the real one, and commission it with painleve commission --port"
    )]
    Rehearsed(String),
    /// Slides of an arm whose parts may be mounted in the other direction.
    #[error(
        "this scenario has never been commissioned: if a sensor or a stage is mounted in the other direction, the feedback is positive; measure the arm with painleve commission first"
    )]
    NotCommissioned,
    /// Second sensors of an arm whose scenario says that it has none.
    #[error(
        "--second-sensors: the scenario says that the arm has none (converters.mounting.sensors = first): if it has two on each channel, set that to both; otherwise, leave the option out"
    )]
    NoSecondSensors,
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

impl InputError {
    /// Refuses the options of a rehearsal without one.
    ///
    /// # Errors
    /// [`InputError::Needs`].
    pub fn check_rehearsal(
        rehearses: bool,
        mistake: Option<&String>,
        seed: Option<u64>,
    ) -> Result<(), Self> {
        let given = [("--mistake", mistake.is_some()), ("--seed", seed.is_some())];
        Self::check_needed("--rehearse", rehearses, &given)
    }

    /// Refuses options that are given without `needed`. clap's `requires` passes over one that conflicts with
    /// another given option.
    ///
    /// # Errors
    /// [`InputError::Needs`].
    pub fn check_needed(
        needed: &'static str,
        is_there: bool,
        options: &[(&'static str, bool)],
    ) -> Result<(), Self> {
        match options.iter().find(|(_, is_given)| *is_given) {
            Some(&(option, _)) if !is_there => Err(Self::Needs { option, needed }),
            _ => Ok(()),
        }
    }

    /// A record, or a table of ticks, that cannot be used.
    pub fn record(path: &Path, source: impl Into<RecordFileError>) -> Self {
        let source = match source.into() {
            RecordFileError::Content(ExportError::Incomplete(_))
                if !input_file::begins_as_mcap(path) =>
            {
                RecordFileError::NoRecord
            }
            source => source,
        };
        Self::Record {
            path: path.to_path_buf(),
            source,
        }
    }
}

/// Returns how an output's path leads to an input of another path.
fn also(path: &Path, input: &Path) -> String {
    if path == input {
        String::new()
    } else {
        format!(", because `{}` is the same file", path.display())
    }
}

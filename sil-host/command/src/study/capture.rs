//! `painleve study capture`: a bouncing arm is caught.

use clap::Args;
use painleve_study::StudyError;
use painleve_study::capture::{Capture, Captures};

use super::options::{self, OutcomeOptions, Overrides};
use crate::CommandError;

/// Options of `painleve study capture`.
#[derive(Debug, Args)]
pub struct CaptureArguments {
    /// Seed of all runs.
    #[arg(long, default_value_t = 1, allow_negative_numbers = true)]
    seed: u64,
    /// Number of runs.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 1000,
        value_parser = options::runs,
        allow_negative_numbers = true
    )]
    runs: usize,
    #[command(flatten)]
    overrides: Overrides,
    #[command(flatten)]
    outcome: OutcomeOptions,
}

impl CaptureArguments {
    /// The study that is asked for, checked.
    ///
    /// # Errors
    /// [`StudyError`] naming the key that is wrong.
    pub fn study(&self) -> Result<Capture, StudyError> {
        let study = Capture {
            seed: self.seed,
            runs: self.runs,
            overrides: self.overrides.overrides.clone(),
        };
        study.check()?;
        Ok(study)
    }
}

/// Computes the study and writes it.
pub fn run(arguments: &CaptureArguments) -> Result<(), CommandError> {
    let study = arguments.study()?;
    let rows = arguments.outcome.compute(&study)?;
    arguments.outcome.write(&Captures::new(rows))
}

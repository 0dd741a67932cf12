//! `painleve study lift-off`: how soon a lift-off is noticed.

use clap::Args;
use painleve_study::StudyError;
use painleve_study::lift_off::{LiftOff, LiftOffs};

use super::options::{self, OutcomeOptions, Overrides};
use crate::CommandError;

/// Options of `painleve study lift-off`.
#[derive(Debug, Args)]
pub struct LiftOffArguments {
    /// Seed of all runs.
    #[arg(long, default_value_t = 1, allow_negative_numbers = true)]
    seed: u64,
    /// Number of runs.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 1200,
        value_parser = options::runs,
        allow_negative_numbers = true
    )]
    runs: usize,
    /// How long the tip slides before it is led over the edge, s.
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = 10.0,
        value_parser = options::seconds,
        allow_negative_numbers = true
    )]
    slide_s: f64,
    #[command(flatten)]
    overrides: Overrides,
    #[command(flatten)]
    outcome: OutcomeOptions,
}

impl LiftOffArguments {
    /// The study that is asked for, checked.
    ///
    /// # Errors
    /// [`StudyError`] naming the key that is wrong.
    pub fn study(&self) -> Result<LiftOff, StudyError> {
        let study = LiftOff {
            seed: self.seed,
            runs: self.runs,
            slide_s: self.slide_s,
            overrides: self.overrides.overrides.clone(),
        };
        study.check()?;
        Ok(study)
    }
}

/// Computes the study and writes it.
pub fn run(arguments: &LiftOffArguments) -> Result<(), CommandError> {
    let study = arguments.study()?;
    let rows = arguments.outcome.compute(&study)?;
    arguments.outcome.write(&LiftOffs::new(rows))
}

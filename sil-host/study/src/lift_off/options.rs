//! Options of the study: how soon a lift-off is detected.

use clap::Args;

use super::{LiftOff, LiftOffs, Row};
use crate::StudyError;
use crate::catalogue::{StudyOptions, in_shards};
use crate::tabular::Table;

use crate::options::{self, Overrides};

/// How soon a lift-off is detected, with the force cell and without.
#[derive(Debug, Args)]
pub struct Options {
    /// Seed of all runs.
    #[arg(long, default_value_t = 1, allow_negative_numbers = true)]
    seed: u64,
    /// Number of runs with each kind of evidence.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 1200,
        value_parser = options::runs,
        allow_negative_numbers = true
    )]
    runs: usize,
    /// Sliding time before the tip is led over the edge, s.
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
}

impl StudyOptions for Options {
    const NAME: &'static str = "lift-off";
    const HAS_SHARDS: bool = true;
    type Study = LiftOff;
    type Outcome = LiftOffs;

    fn study(&self) -> Result<LiftOff, StudyError> {
        let study = LiftOff {
            seed: self.seed,
            runs: self.runs,
            slide_s: self.slide_s,
            overrides: self.overrides.overrides.clone(),
        };
        study.check()?;
        Ok(study)
    }

    fn outcome(_: &LiftOff, rows: Vec<Row>) -> LiftOffs {
        LiftOffs::new(rows)
    }

    fn table(study: LiftOff) -> Option<Box<dyn Table>> {
        in_shards(study)
    }
}

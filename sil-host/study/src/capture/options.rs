//! Options of the study: capture of a bouncing arm.

use clap::Args;

use super::{Capture, Captures, Row};
use crate::StudyError;
use crate::catalogue::{StudyOptions, in_shards};
use crate::tabular::Table;

use crate::options::{self, Overrides};

/// How soon a bouncing arm is captured.
#[derive(Debug, Args)]
pub struct Options {
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
}

impl StudyOptions for Options {
    const NAME: &'static str = "capture";
    const HAS_SHARDS: bool = true;
    type Study = Capture;
    type Outcome = Captures;

    fn study(&self) -> Result<Capture, StudyError> {
        let study = Capture {
            seed: self.seed,
            runs: self.runs,
            overrides: self.overrides.overrides.clone(),
        };
        study.check()?;
        Ok(study)
    }

    fn outcome(_: &Capture, rows: Vec<Row>) -> Captures {
        Captures::new(rows)
    }

    fn table(study: Capture) -> Option<Box<dyn Table>> {
        in_shards(study)
    }
}

//! Options of the study: capture of a bouncing arm.

use clap::Args;

use super::{Capture, Captures, Row};
use crate::StudyError;
use crate::catalogue::{StudyOptions, in_shards};
use crate::register_study;
use crate::tabular::Table;

use crate::options::RandomRuns;

/// Time until a bouncing arm is captured.
#[derive(Debug, Args)]
pub struct Options {
    #[command(flatten)]
    runs: RandomRuns,
}

register_study!(Options);

impl StudyOptions for Options {
    const NAME: &'static str = "capture";
    const ORDER: u32 = 100;
    const HAS_SHARDS: bool = true;
    type Study = Capture;
    type Outcome = Captures;

    fn study(&self) -> Result<Capture, StudyError> {
        let study = Capture {
            seed: self.runs.seed,
            runs: self.runs.runs,
            overrides: self.runs.overrides(),
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

//! Options of the study: capture of a bouncing arm.

use clap::Args;
use painleve_study_core::StudyError;
use painleve_study_core::catalogue::{InShards, StudyOptions, in_shards};
use painleve_study_core::options::RandomRuns;
use painleve_study_core::trial::Trial;

use super::{Capture, Captures, FIXED, Row};

/// Time until a bouncing arm is captured.
#[derive(Debug, Args)]
pub struct Options {
    #[command(flatten)]
    runs: RandomRuns,
}

impl StudyOptions for Options {
    const NAME: &'static str = "capture";
    const IN_SHARDS: Option<InShards<Self::Study>> = Some(in_shards);
    type Study = Capture;
    type Outcome = Captures;

    fn study(&self) -> Result<Capture, StudyError> {
        self.runs.set.refuse_fixed(&FIXED)?;
        let study = Capture {
            seed: self.runs.seed,
            runs: self.runs.runs,
            overrides: self.runs.overrides(),
        };
        // An invalid override is reported before any run starts.
        Trial::new(&study.scenario(0)?)?;
        Ok(study)
    }

    fn outcome(_: &Capture, rows: Vec<Row>) -> Captures {
        Captures::new(rows)
    }
}

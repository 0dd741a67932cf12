//! Options of the study: delay in detecting a lift-off.

use clap::Args;
use painleve_study_core::StudyError;
use painleve_study_core::catalogue::{InShards, StudyOptions, in_shards};
use painleve_study_core::options::{self, RandomRuns};
use painleve_study_core::trial::Trial;

use super::{LiftOff, LiftOffs, Row};
use crate::robustness;

/// Delay in detecting a lift-off, with the force cell and without.
#[derive(Debug, Args)]
#[command(mut_arg("runs", |runs| runs.default_value("1200").help("Number of runs with each kind of evidence")))]
pub struct Options {
    #[command(flatten)]
    runs: RandomRuns,
    /// Sliding time before the reference leads the tip beyond the edge, s.
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = 10.0,
        value_parser = options::seconds
    )]
    slide_s: f64,
}

impl StudyOptions for Options {
    const NAME: &'static str = "lift-off";
    const IN_SHARDS: Option<InShards<Self::Study>> = Some(in_shards);
    type Study = LiftOff;
    type Outcome = LiftOffs;

    fn study(&self) -> Result<LiftOff, StudyError> {
        self.runs
            .set
            .refuse_fixed(&["controller.contact.evidence", "controller.governor.enabled"])?;
        self.runs.set.refuse_fixed(&robustness::FIXED)?;
        let study = LiftOff {
            seed: self.runs.seed,
            runs: self.runs.runs,
            slide_s: self.slide_s,
            overrides: self.runs.overrides(),
        };
        // An invalid override is reported before any run starts.
        Trial::new(&study.scenario(0)?)?;
        Ok(study)
    }

    fn outcome(_: &LiftOff, rows: Vec<Row>) -> LiftOffs {
        LiftOffs::new(rows)
    }
}

//! Options of the campaign.

use clap::Args;
use painleve_study_core::StudyError;
use painleve_study_core::catalogue::{InShards, StudyOptions, in_shards};
use painleve_study_core::grid::once;
use painleve_study_core::options::RandomRuns;
use painleve_study_core::trial::Trial;

use super::{Arms, Criterion, FIXED, Part, Robustness, RobustnessOutcome, Row};

/// A campaign of random arms, belts, converters and losses that the controller does not know.
#[derive(Debug, Args)]
#[command(mut_arg("runs", |runs| runs.default_value("10000")))]
pub struct Options {
    /// Arms: the paper's arm with errors, or any arm, known to the controller.
    #[arg(long, value_enum, default_value = "paper")]
    arms: Arms,
    /// Parts of the controller to switch off.
    #[arg(long, value_name = "PARTS", value_enum, value_delimiter = ',')]
    without: Vec<Part>,
    /// What counts as a success: the tip was kept on the belt without a fault, or is also in place at the end.
    #[arg(long, value_enum, default_value_t)]
    criterion: Criterion,
    #[command(flatten)]
    runs: RandomRuns,
}

impl StudyOptions for Options {
    const NAME: &'static str = "robustness";
    const IN_SHARDS: Option<InShards<Self::Study>> = Some(in_shards);
    type Study = Robustness;
    type Outcome = RobustnessOutcome;

    fn study(&self) -> Result<Robustness, StudyError> {
        self.runs.set.refuse_fixed(&FIXED)?;
        let parts = once(&self.without).into_iter().flat_map(Part::without);
        let study = Robustness {
            arms: self.arms,
            seed: self.runs.seed,
            criterion: self.criterion,
            runs: self.runs.runs,
            overrides: parts
                .map(ToString::to_string)
                .chain(self.runs.overrides())
                .collect(),
        };
        // An invalid override is reported before any run starts.
        Trial::new(&study.scenario(0)?)?;
        Ok(study)
    }

    fn outcome(study: &Robustness, rows: Vec<Row>) -> RobustnessOutcome {
        RobustnessOutcome::new(study, rows)
    }
}

//! Options of the campaign.

use clap::Args;

use super::{Arms, Part, Robustness, RobustnessOutcome, Row};
use crate::StudyError;
use crate::catalogue::{StudyOptions, in_shards};
use crate::tabular::Table;

use crate::options::{self, Overrides};

/// A campaign of random arms, belts, converters and losses that the controller does not know.
#[derive(Debug, Args)]
pub struct Options {
    /// Arms: the paper's arm with errors, or any arm, known to the controller.
    #[arg(long, value_enum, default_value = "paper")]
    arms: Arms,
    /// Seed of all runs.
    #[arg(long, default_value_t = 1, allow_negative_numbers = true)]
    seed: u64,
    /// Number of runs.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 10000,
        value_parser = options::runs,
        allow_negative_numbers = true
    )]
    runs: usize,
    /// Parts of the controller to switch off.
    #[arg(long, value_name = "PARTS", value_enum, value_delimiter = ',')]
    without: Vec<Part>,
    #[command(flatten)]
    overrides: Overrides,
}

impl StudyOptions for Options {
    const NAME: &'static str = "robustness";
    const HAS_SHARDS: bool = true;
    type Study = Robustness;
    type Outcome = RobustnessOutcome;

    fn study(&self) -> Result<Robustness, StudyError> {
        let parts = self.without.iter().flat_map(|part| part.without());
        let mut overrides: Vec<String> = parts.map(ToString::to_string).collect();
        overrides.extend(self.overrides.overrides.iter().cloned());
        let study = Robustness {
            arms: self.arms,
            seed: self.seed,
            runs: self.runs,
            overrides,
        };
        study.check()?;
        Ok(study)
    }

    fn outcome(study: &Robustness, rows: Vec<Row>) -> RobustnessOutcome {
        RobustnessOutcome::new(study.arms, study.seed, rows)
    }

    fn table(study: Robustness) -> Option<Box<dyn Table>> {
        in_shards(study)
    }
}

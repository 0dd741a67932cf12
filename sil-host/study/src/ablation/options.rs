//! Options of the study.

use clap::Args;

use super::{Ablation, AblationStudy};
use crate::StudyError;
use crate::catalogue::StudyOptions;
use crate::options::{self, Overrides};
use crate::robustness::{Arms, Part, Robustness, Row};

/// What each part of the controller contributes to the robustness campaign.
#[derive(Debug, Args)]
pub struct Options {
    /// Arms of the campaign: the paper's arm with errors, or any arm, known to the controller.
    #[arg(long, value_enum, default_value = "paper")]
    arms: Arms,
    /// Seed of all runs.
    #[arg(long, default_value_t = 1, allow_negative_numbers = true)]
    seed: u64,
    /// Number of runs with each part switched off.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 500,
        value_parser = options::runs,
        allow_negative_numbers = true
    )]
    runs: usize,
    /// Parts to switch off, one at a time; all parts by default.
    #[arg(long, value_name = "PARTS", value_enum, value_delimiter = ',')]
    without: Vec<Part>,
    #[command(flatten)]
    overrides: Overrides,
}

impl StudyOptions for Options {
    const NAME: &'static str = "ablation";
    type Study = AblationStudy;
    type Outcome = Ablation;

    fn study(&self) -> Result<AblationStudy, StudyError> {
        let study = AblationStudy {
            campaign: Robustness {
                arms: self.arms,
                seed: self.seed,
                runs: self.runs,
                overrides: self.overrides.overrides.clone(),
            },
            parts: if self.without.is_empty() {
                Part::ALL.to_vec()
            } else {
                self.without.clone()
            },
        };
        study.campaign.check()?;
        Ok(study)
    }

    fn outcome(study: &AblationStudy, rows: Vec<Row>) -> Ablation {
        Ablation::new(study, rows)
    }
}

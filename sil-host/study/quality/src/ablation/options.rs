//! Options of the study.

use clap::Args;
use painleve_study_core::StudyError;
use painleve_study_core::catalogue::StudyOptions;

use super::{Ablation, AblationStudy};
use crate::robustness::{CampaignOptions, Part, Row};

/// Contribution of each part of the controller to success in the robustness campaign.
#[derive(Debug, Args)]
#[command(
    mut_arg("runs", |runs| runs.default_value("500").help("Number of runs with each part switched off")),
    mut_arg("without", |without| without.help("Parts to switch off, one at a time; all parts by default"))
)]
pub struct Options {
    #[command(flatten)]
    campaign: CampaignOptions,
}

impl StudyOptions for Options {
    const NAME: &'static str = "ablation";
    type Study = AblationStudy;
    type Outcome = Ablation;

    fn study(&self) -> Result<AblationStudy, StudyError> {
        let study = AblationStudy {
            campaign: self.campaign.campaign(),
            parts: if self.campaign.without.is_empty() {
                Part::ALL.to_vec()
            } else {
                self.campaign.without.clone()
            },
        };
        study.campaign.check()?;
        Ok(study)
    }

    fn outcome(study: &AblationStudy, rows: Vec<Row>) -> Ablation {
        Ablation::new(study, rows)
    }
}

//! The robustness campaign, repeated with one part of the controller switched off at a time.

mod figure;
mod options;
mod outcome;
#[cfg(test)]
mod tables;

use painleve_plant::mechanics::BuiltInPlant;
use painleve_study_core::loop_study::{LoopStudy, MakePlant};
use painleve_study_core::{Study, StudyError};

use crate::robustness::{Part, Robustness, Row};

pub use options::Options;
pub use outcome::{Ablated, Ablation};

/// The robustness campaign, repeated with one part of the controller switched off at a time.
#[derive(Clone, Debug)]
pub struct AblationStudy {
    /// The campaign.
    pub campaign: Robustness,
    /// The parts to switch off; the first entry is the whole controller.
    pub parts: Vec<Part>,
}

impl Study for AblationStudy {
    type Row = Row;

    fn len(&self) -> usize {
        painleve_study_core::combinations(&[self.parts.len() + 1, self.campaign.runs])
    }

    fn row(&self, index: usize) -> Result<Row, StudyError> {
        self.row_on(index, &BuiltInPlant::new)
    }
}

impl LoopStudy for AblationStudy {
    fn row_on(&self, index: usize, plants: &impl MakePlant) -> Result<Row, StudyError> {
        let mut campaign = self.campaign.clone();
        let part = index / campaign.runs;
        if let Some(part) = part.checked_sub(1).and_then(|part| self.parts.get(part)) {
            let keys = part.without().iter().map(ToString::to_string);
            campaign.overrides.extend(keys);
        }
        campaign.row_on(index % campaign.runs, plants)
    }
}

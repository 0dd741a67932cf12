//! Random closed loops, repeated with one part of the controller switched off at a time.

mod condition;
mod figure;
mod options;
mod outcome;
#[cfg(test)]
mod tables;

use painleve_plant::mechanics::BuiltInPlant;
use painleve_study_core::loop_study::{LoopStudy, MakePlant};
use painleve_study_core::trial::Trial;
use painleve_study_core::{Study, StudyError};

use crate::robustness::{Part, Row, judge};

pub use condition::Condition;
pub use options::Options;
pub use outcome::{Ablated, Ablation};

/// Random closed loops under some conditions, repeated with one part of the controller switched off at a time.
#[derive(Clone, Debug)]
pub struct AblationStudy {
    /// The conditions.
    pub conditions: Vec<Condition>,
    /// The parts to switch off.
    pub parts: Vec<Part>,
    /// Seed of all runs.
    pub seed: u64,
    /// Number of runs of each controller under each condition.
    pub runs: usize,
    /// Overrides applied to every scenario after it is drawn.
    pub overrides: Vec<String>,
}

impl AblationStudy {
    /// Returns every condition with each part that is switched off there, in the order of the rows; the whole
    /// controller comes first.
    pub fn cells(&self) -> Vec<(Condition, Option<Part>)> {
        let parts = || std::iter::once(None).chain(self.parts.iter().copied().map(Some));
        let conditions = self.conditions.iter();
        conditions
            .flat_map(|condition| parts().map(|part| (*condition, part)))
            .collect()
    }

    /// Builds the first run of every condition, so that an invalid override is reported before any run starts.
    ///
    /// # Errors
    /// [`StudyError`] if one cannot be built.
    pub fn check(&self) -> Result<(), StudyError> {
        for condition in &self.conditions {
            let (scenario, _) = condition.scenario(self.seed, 0, &self.overrides)?;
            Trial::new(&scenario)?;
        }
        Ok(())
    }
}

impl Study for AblationStudy {
    type Row = Row;

    fn len(&self) -> usize {
        painleve_study_core::combinations(&[self.cells().len(), self.runs])
    }

    fn row(&self, index: usize) -> Result<Row, StudyError> {
        self.row_on(index, &BuiltInPlant::new)
    }
}

impl LoopStudy for AblationStudy {
    fn row_on(&self, index: usize, plants: &impl MakePlant) -> Result<Row, StudyError> {
        let (cell, run) = (index / self.runs, index % self.runs);
        let (condition, without) = self.cells()[cell];
        let keys = without.iter().flat_map(|part| part.without());
        let mut overrides = self.overrides.clone();
        overrides.extend(keys.map(ToString::to_string));
        let (scenario, lift_offs) = condition.scenario(self.seed, run, &overrides)?;
        judge::run(plants.make(&scenario)?, &scenario, run, lift_offs)
    }
}

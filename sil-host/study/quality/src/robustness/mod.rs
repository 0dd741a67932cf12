//! The robustness campaign: closed loops drawn at random, with an arm, a belt, converters
//! and a link that the controller does not know.
//!
//! A run succeeds if the tip is captured in time and never leaves the belt again, without a fault. Where it ends is
//! told apart from that: its distance from the governed reference, and from the true edge where the governed one holds
//! it. By [`Criterion::InPlace`], a success must also end in place.

mod arms;
mod draw;
mod false_alarms;
mod figure;
pub(crate) mod judge;
mod options;
mod outcome;
mod part;
mod row;

use std::collections::BTreeMap;

use painleve_plant::Plant;
use painleve_plant::mechanics::BuiltInPlant;
use painleve_plant::scenario::Scenario;
use painleve_study_core::loop_study::{LoopStudy, MakePlant};
use painleve_study_core::tabular::Tabular;
use painleve_study_core::{Study, StudyError};

pub use arms::Arms;
pub(crate) use draw::Journey;
pub use draw::scenario;
pub use false_alarms::FalseAlarms;
pub use judge::LiftOffRule;
pub use options::Options;
pub use outcome::{Place, RobustnessOutcome};
pub use part::Part;
pub use row::{Criterion, Ending, Row};

/// The shape of the arm, on which the study places start and target of every run.
pub const FIXED: [&str; 2] = ["arm.link_length_m", "arm.height_m"];

/// Settings of the campaign.
#[derive(Clone, Debug)]
pub struct Robustness {
    /// The arms of the campaign.
    pub arms: Arms,
    /// Seed of all runs.
    pub seed: u64,
    /// What counts as a success.
    pub criterion: Criterion,
    /// Number of runs.
    pub runs: usize,
    /// Overrides applied to every scenario after it is drawn.
    pub overrides: Vec<String>,
}

impl Robustness {
    /// Returns the scenario of a run.
    ///
    /// # Errors
    /// [`StudyError`] if an override is invalid.
    pub fn scenario(&self, index: usize) -> Result<Scenario, StudyError> {
        let scenario = scenario(self.arms, self.seed, index as u64)?;
        Ok(scenario.with_overrides("robustness campaign", &self.overrides)?)
    }
}

impl Study for Robustness {
    type Row = Row;

    fn len(&self) -> usize {
        self.runs
    }

    fn row(&self, index: usize) -> Result<Row, StudyError> {
        self.row_on(index, &BuiltInPlant::new)
    }
}

impl LoopStudy for Robustness {
    fn row_on(&self, index: usize, plants: &impl MakePlant) -> Result<Row, StudyError> {
        let scenario = self.scenario(index)?;
        judge::run(plants.make(&scenario)?, &scenario, index, LiftOffRule::Fail)
    }
}

/// Runs a scenario with one reference, on a plant in its initial state, and judges how it ends; `index` is its number in
/// its campaign.
///
/// # Errors
/// [`StudyError`] if the scenario is invalid.
pub fn run_on(plant: impl Plant, index: usize, scenario: &Scenario) -> Result<Row, StudyError> {
    judge::run(plant, scenario, index, LiftOffRule::Fail)
}

impl Tabular for Robustness {
    fn seeds(&self) -> Result<BTreeMap<String, u64>, StudyError> {
        Ok(BTreeMap::from([("runs".into(), self.seed)]))
    }
}

#[cfg(test)]
pub(crate) mod tables;
#[cfg(test)]
mod tests;

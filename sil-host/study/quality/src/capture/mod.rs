//! Capture of a bouncing arm: the controller is switched on at a random phase of the bouncing.

mod figure;
mod options;
mod outcome;

use std::collections::BTreeMap;

use painleve_plant::contact_probe::ContactProbe;
use painleve_plant::mechanics::BuiltInPlant;
use painleve_plant::scenario::{InitialState, Scenario};
use painleve_study_core::loop_study::{LoopStudy, MakePlant};
use painleve_study_core::tabular::Tabular;
use painleve_study_core::trial::Trial;
use painleve_study_core::{Study, StudyError};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use serde::Serialize;

pub use options::Options;
pub use outcome::Captures;

/// Shortest time of bouncing before the controller is switched on, s.
const BOUNCES_S: f64 = 5.0;
/// Interval within which the controller is switched on, s; it spans many bounces.
const PHASES_S: f64 = 2.0;
/// Duration of a run after switching on, s.
const CAUGHT_S: f64 = 2.0;
/// Latest time for the last landing, s.
const LIMIT_S: f64 = 0.5;
/// Final interval in which the tip must be at its reference, s, and the tolerance, m.
const WATCHED_S: f64 = 0.1;
const WITHIN_M: f64 = 1e-3;

/// The keys that the study sets in every run.
pub const FIXED: [&str; 2] = ["run.enable_at_s", "run.duration_s"];

/// Settings of the study.
#[derive(Clone, Debug)]
pub struct Capture {
    /// Seed of all runs.
    pub seed: u64,
    /// Number of runs.
    pub runs: usize,
    /// Changes to every scenario.
    pub overrides: Vec<String>,
}

/// One run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Number of the run.
    pub index: usize,
    /// Time at which the controller was switched on, s.
    pub enabled_s: f64,
    /// Seed of the noise.
    pub noise_seed: u64,
    /// Time from switching on to the end of the last flight, s.
    pub capture_s: f64,
    /// Largest distance from the reference in the final interval, m.
    pub error_m: f64,
    /// Number of the latched fault.
    pub fault: Option<u8>,
    /// Final tip position, m.
    pub tip_t_m: f64,
    /// Whether the tip was captured in time and held its reference.
    pub success: bool,
    /// Whether the plant could be solved to the end; otherwise the other fields describe the run
    /// until then.
    pub solved: bool,
}

impl Capture {
    /// Returns the scenario of a run: x0,a, 0.5 % noise of the force cell, and as reference only
    /// the position at which the tip is captured.
    ///
    /// # Errors
    /// [`StudyError`] if an override is invalid.
    pub fn scenario(&self, index: usize) -> Result<Scenario, StudyError> {
        let mut generator = ChaCha8Rng::seed_from_u64(self.seed);
        generator.set_stream(index as u64);
        let mut scenario = Scenario::load_unplaced("hybrid-elbow-down", &[])?;
        scenario.initial = InitialState::at_rest(32.0, 18.27);
        scenario.converters.force.noise_n = 0.1;
        scenario.controller.reference.segments.clear();
        let enable_at_s = BOUNCES_S + generator.random_range(0.0..PHASES_S);
        scenario.run.enable_at_s = enable_at_s;
        scenario.run.duration_s = enable_at_s + CAUGHT_S;
        scenario.run.seed = generator.random::<u64>() >> 1;
        Ok(scenario.with_overrides("capture", &self.overrides)?)
    }
}

impl Study for Capture {
    type Row = Row;

    fn len(&self) -> usize {
        self.runs
    }

    fn row(&self, index: usize) -> Result<Row, StudyError> {
        self.row_on(index, &BuiltInPlant::new)
    }
}

impl LoopStudy for Capture {
    fn row_on(&self, index: usize, plants: &impl MakePlant) -> Result<Row, StudyError> {
        let scenario = self.scenario(index)?;
        let enabled_s = scenario.run.enable_at_s;
        let end_s = scenario.run.duration_s;
        let mut trial = Trial::on(plants.make(&scenario)?, &scenario)?;
        let mut contact = ContactProbe::new(enabled_s, 0.0);
        let mut error_m = 0.0_f64;
        let mut solved = true;
        for _ in 0..scenario.run.ticks() {
            if trial.tick(&mut contact).is_err() {
                solved = false;
                break;
            }
            if trial.time_s() > end_s - WATCHED_S {
                let reference_m = trial.answer().reference_tip.to_metres();
                error_m = error_m.max((trial.tip_t_m() - reference_m).abs());
            }
        }
        let capture_s = contact.last_flight_end_s - enabled_s;
        let fault = trial.fault().map(|fault| fault as u8);
        Ok(Row {
            index,
            enabled_s,
            noise_seed: scenario.run.seed,
            capture_s,
            error_m,
            fault,
            tip_t_m: trial.tip_t_m(),
            success: solved && capture_s <= LIMIT_S && error_m <= WITHIN_M && fault.is_none(),
            solved,
        })
    }
}

impl Tabular for Capture {
    fn seeds(&self) -> Result<BTreeMap<String, u64>, StudyError> {
        Ok(BTreeMap::from([("runs".into(), self.seed)]))
    }
}

#[cfg(test)]
mod tests;

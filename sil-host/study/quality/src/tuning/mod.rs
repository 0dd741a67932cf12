//! A search for settings of a scenario: bounded, seeded, parallel, and continued where it ended.
//!
//! A trial runs the scenario in some cases: with other friction, other masses than the controller's model has, and other
//! noise. Its cost is the mean of tracking error, force ripple and change of torque, each relative to the given scenario,
//! and a penalty for cases in which the tip leaves the belt or a fault is latched. Every third trial is
//! anywhere in the ranges, equally on a logarithmic scale; the others are near the best so far, closer and closer.
//! A trial depends on the seed and on the earlier trials only: a list of them continues the search, to any number.

mod figure;
mod search;
#[cfg(test)]
mod tests;

use painleve_plant::closed_loop::{ClosedLoop, LoopError, Monitor};
use painleve_plant::controller_host::InProcess;
use painleve_plant::sample::Sample;
use painleve_plant::scenario::{KeyError, Scenario, ScenarioError};
use painleve_plant::simulation::Simulation;
use painleve_process::interrupt::Interrupt;
use painleve_study_core::StudyError;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use rayon::prelude::*;
use serde::Serialize;

pub use figure::svg;
pub use search::{BATCH, Range, RangeError};

/// Largest changes of a case: of the friction, and of the masses beyond the controller's model, relative.
const FRICTION: f64 = 0.2;
const MASS: f64 = 0.05;
/// What a case without success adds to the cost, in costs of the given scenario.
const NOT_KEPT: f64 = 10.0;
/// A value of the given scenario below which a part of the cost is not compared with it: a part that is absent.
const LEAST: f64 = 1e-12;

/// A search.
#[derive(Clone, Debug)]
pub struct Tuning {
    /// The scenario.
    pub scenario: Scenario,
    /// The keys to search, with their ranges.
    pub ranges: Vec<Range>,
    /// Number of cases of a trial.
    pub cases: usize,
    /// Seed of search and cases.
    pub seed: u64,
    /// Ends the cases that run; what they score is then worthless.
    pub interrupt: Interrupt,
}

/// How well a scenario does in some cases: means over them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Score {
    /// Share of the cases in which the tip stays on the belt and no fault is latched.
    pub kept: f64,
    /// Root mean square of the tracking error, mm.
    pub error_mm: f64,
    /// Standard deviation of the normal force while the reference stands, N.
    pub ripple_n: f64,
    /// Root mean square of the change of torque from tick to tick, N·m.
    pub torque_change_nm: f64,
}

/// A trial.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// The values of the keys.
    pub values: Vec<f64>,
    /// What they achieve.
    pub score: Score,
    /// Their cost; the given scenario's is 1 if it keeps the tip in every case.
    pub cost: f64,
}

impl Score {
    /// Returns the cost of this score beside that of the given scenario.
    pub fn cost(&self, given: &Self) -> f64 {
        let parts = [
            (self.error_mm, given.error_mm),
            (self.ripple_n, given.ripple_n),
            (self.torque_change_nm, given.torque_change_nm),
        ];
        let compared = parts.iter().filter(|(_, given)| *given > LEAST);
        let (sum, count) = compared.fold((0.0, 0.0), |(sum, count), (value, given)| {
            (sum + value / given, count + 1.0)
        });
        let mean = if count > 0.0 { sum / count } else { 1.0 };
        mean + NOT_KEPT * (1.0 - self.kept)
    }
}

impl Tuning {
    /// Checks both ends of every range.
    ///
    /// # Errors
    /// [`StudyError`] naming the key that is wrong.
    pub fn check(&self) -> Result<(), StudyError> {
        for end in [0.0, 1.0] {
            let values: Vec<f64> = self.ranges.iter().map(|range| range.at(end)).collect();
            let scenario = self.with(&values).map_err(|error| match error {
                StudyError::Scenario(
                    source @ ScenarioError::Key {
                        source: KeyError::Value { .. },
                        ..
                    },
                ) => StudyError::NotFractional(source),
                error => error,
            })?;
            Simulation::new(&scenario)?;
        }
        Ok(())
    }

    /// Returns the scenario with these values of the keys.
    ///
    /// # Errors
    /// [`StudyError`] naming the key that is wrong.
    pub fn with(&self, values: &[f64]) -> Result<Scenario, StudyError> {
        let overrides: Vec<String> = self
            .ranges
            .iter()
            .zip(values)
            .map(|(range, value)| format!("{}={value:?}", range.key))
            .collect();
        Ok(self
            .scenario
            .clone()
            .with_overrides("tuned scenario", &overrides)?)
    }

    /// Scores a scenario in the cases of a seed.
    ///
    /// # Errors
    /// [`StudyError`] if a case cannot be run.
    pub fn score(&self, scenario: &Scenario, cases: usize, seed: u64) -> Result<Score, StudyError> {
        let all: Vec<Score> = (0..cases)
            .map(|index| run(&case(scenario, seed, index as u64), &self.interrupt))
            .collect::<Result<_, _>>()?;
        let mean = |value: fn(&Score) -> f64| all.iter().map(value).sum::<f64>() / cases as f64;
        Ok(Score {
            kept: mean(|case| case.kept),
            error_mm: mean(|case| case.error_mm),
            ripple_n: mean(|case| case.ripple_n),
            torque_change_nm: mean(|case| case.torque_change_nm),
        })
    }

    /// Returns the next trials after `trials`, the first batch of which begins the search. They are computed on the
    /// threads of the current rayon pool.
    ///
    /// # Errors
    /// [`StudyError`] of the first trial that cannot be run.
    pub fn next_trials(
        &self,
        trials: &[Trial],
        all: usize,
        given: &Score,
    ) -> Result<Vec<Trial>, StudyError> {
        let first = trials.len();
        let last = (first - first % BATCH + BATCH).min(all);
        (first..last)
            .into_par_iter()
            .map(|index| {
                let values = search::values(&self.ranges, trials, index, self.seed);
                let score = self.score(&self.with(&values)?, self.cases, self.seed)?;
                Ok(Trial {
                    values,
                    score,
                    cost: score.cost(given),
                })
            })
            .collect()
    }
}

/// Returns a scenario in one of its cases.
fn case(scenario: &Scenario, seed: u64, index: u64) -> Scenario {
    let mut generator = ChaCha8Rng::seed_from_u64(seed);
    generator.set_stream(index);
    let mut case = scenario.clone();
    // The controller keeps the model that it has.
    case.arm_model = Some(scenario.controller_configuration().arm);
    case.run.seed = generator.random::<u64>() >> 1;
    case.belt.friction *= generator.random_range(1.0 - FRICTION..1.0 + FRICTION);
    for mass_kg in &mut case.arm.link_mass_kg {
        *mass_kg *= generator.random_range(1.0 - MASS..1.0 + MASS);
    }
    case
}

/// Sums the squares of the tracking error.
#[derive(Default)]
struct Errors {
    squares_m2: f64,
    ticks: u64,
}

impl Monitor for Errors {
    fn sample(&mut self, sample: &Sample) -> Result<(), LoopError> {
        let error_m = sample.plant.tip_t_m - sample.reference_tip_t_m;
        if error_m.is_finite() {
            self.squares_m2 += error_m * error_m;
            self.ticks += 1;
        }
        Ok(())
    }
}

/// Scores one case.
fn run(scenario: &Scenario, interrupt: &Interrupt) -> Result<Score, StudyError> {
    let host = InProcess::new(&scenario.controller_configuration())?;
    let mut closed_loop = ClosedLoop::new(Simulation::new(scenario)?, host);
    let mut errors = Errors::default();
    let mut goes_on = true;
    for _ in 0..scenario.run.ticks() {
        goes_on = !interrupt.is_requested() && closed_loop.tick(&mut errors).is_ok();
        if !goes_on {
            break;
        }
    }
    let (result, _) = closed_loop.finish();
    let change = |roughness: &painleve_plant::smoothness::Roughness| {
        roughness
            .torque_change_nm(&scenario.converters)
            .unwrap_or_default()
    };
    let (moving, holding) = (&result.smoothness.moving, &result.smoothness.holding);
    let is_kept = goes_on && result.is_kept();
    Ok(Score {
        kept: f64::from(u8::from(is_kept)),
        error_mm: 1e3 * (errors.squares_m2 / errors.ticks.max(1) as f64).sqrt(),
        ripple_n: holding.force_ripple_n().unwrap_or_default(),
        torque_change_nm: 0.5 * (change(moving) + change(holding)),
    })
}

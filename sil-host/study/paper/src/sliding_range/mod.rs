//! Sliding range of a controller: the largest reference that the tip reaches within a
//! tolerance without leaving the belt (the paper's Z_t,sliding).
//!
//! Success need not be monotone in the target. All targets on a coarse grid from the start to
//! the limit, p = 0 or the end of the reach, are tried first. The range ends between the last target before
//! the first failure and that failure, where it is bisected. Targets reached
//! beyond the first failure are not part of the range; they are reported as
//! [`Row::reached_beyond_m`].

mod figure;
mod options;
mod outcome;
mod page;

use std::collections::BTreeMap;

use painleve_plant::belt_line::{BeltLine, positive_stretches};
use painleve_plant::mechanics::BuiltInPlant;
use painleve_plant::mechanics::compliant::ContactKind;
use painleve_plant::scenario::Scenario;
use painleve_plant::statistics::Statistics;
use painleve_shared::{Arm, Posture, Slip};
use painleve_study_core::case::{self, ControllerChoice, ConverterChoice, Reference};
use painleve_study_core::loop_study::{LoopStudy, MakePlant};
use painleve_study_core::tabular::Tabular;
use painleve_study_core::trial::Trial;
use painleve_study_core::{Study, StudyError, check_rows, combinations, places};
use rayon::prelude::*;
use serde::Serialize;

use crate::printed;

pub use options::Options;

/// Conditions for reaching a reference, and the resolution of the search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Criterion {
    /// Largest distance from the target, m.
    pub within_m: f64,
    /// Time for which the tip must stay within that distance after the end of the reference, s.
    pub stay_s: f64,
    /// Time limit for this, from the end of the reference, s.
    pub patience_s: f64,
    /// Spacing of the targets tried first, m.
    pub scan_step_m: f64,
    /// Accuracy of the end of the range, m.
    pub resolution_m: f64,
}

impl Default for Criterion {
    fn default() -> Self {
        Self {
            within_m: 1e-3,
            stay_s: 2.0,
            // The paper's PID closes its last millimetre with a time constant of 8 s.
            patience_s: 20.0,
            scan_step_m: 5e-3,
            resolution_m: 1e-4,
        }
    }
}

/// Settings of the study: all combinations, the last varying fastest.
#[derive(Clone, Debug)]
pub struct SlidingRange {
    /// Controllers.
    pub controllers: Vec<ControllerChoice>,
    /// Converter sets.
    pub converters: Vec<ConverterChoice>,
    /// Postures.
    pub postures: Vec<Posture>,
    /// Friction coefficients μ.
    pub mu: Vec<f64>,
    /// References.
    pub references: Vec<Reference>,
    /// Changes to every scenario.
    pub overrides: Vec<String>,
    /// Conditions for reaching a target.
    pub criterion: Criterion,
}

/// Why the range ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum RangeEnd {
    /// The limit p = 0 is reached.
    Limit,
    /// The end of the arm's reach on the belt is reached, where p > 0.
    Reach,
    /// The tip left the belt.
    LiftOff,
    /// The tip came to rest elsewhere, or too late.
    NotReached,
    /// The controller latched a fault.
    Fault,
}

impl RangeEnd {
    fn name(self) -> &'static str {
        match self {
            Self::Limit => "p = 0",
            Self::Reach => "end of reach",
            Self::LiftOff => "lift-off",
            Self::NotReached => "stops short or late",
            Self::Fault => "fault",
        }
    }
}

/// Sliding range of one case.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Controller.
    pub controller: ControllerChoice,
    /// Converter set.
    pub converters: ConverterChoice,
    /// Posture.
    pub posture: Posture,
    /// Friction coefficient.
    pub mu: f64,
    /// Reference.
    pub reference: Reference,
    /// Initial tip position, m.
    pub start_m: f64,
    /// Z_t,sliding, m; null if the first target fails.
    pub z_sliding_m: Option<f64>,
    /// Tip position at which p = 0 in this posture, or else the end of the reach, m.
    pub limit_m: f64,
    /// The paper's Z_t,sliding for this law, posture and μ, m; null if it gives none.
    pub paper_m: Option<f64>,
    /// Tip position at the end of the run to `z_sliding_m`, m.
    pub tip_t_m: Option<f64>,
    /// Result at the next farther target.
    pub ends_by: RangeEnd,
    /// Farthest target beyond the range that was still reached, m.
    pub reached_beyond_m: Option<f64>,
}

enum Trialled {
    Reached { tip_t_m: f64 },
    Failed(RangeEnd),
}

impl SlidingRange {
    /// Builds every case once, so that an error is reported before any case runs.
    ///
    /// # Errors
    /// [`StudyError`] of the first invalid case.
    pub fn check(&self) -> Result<(), StudyError> {
        check_rows(self)?;
        for index in 0..self.len() {
            let case = self.case(index)?;
            Trial::new(&case.scenario)?;
        }
        Ok(())
    }

    /// Returns the numbers of values, of which the first changes fastest from row to row.
    fn counts(&self) -> [usize; 5] {
        [
            self.references.len(),
            self.mu.len(),
            self.postures.len(),
            self.converters.len(),
            self.controllers.len(),
        ]
    }

    fn case(&self, index: usize) -> Result<Case<'_>, StudyError> {
        let [reference, mu, posture, converters, controller] = places(index, self.counts());
        let (reference, mu, posture) = (
            self.references[reference],
            self.mu[mu],
            self.postures[posture],
        );
        let (converters, controller) = (self.converters[converters], &self.controllers[controller]);
        let mut overrides = self.overrides.clone();
        overrides.push(format!("belt.friction={mu}"));
        let scenario = case::scenario(controller, posture, converters, &overrides)?;
        Ok(Case {
            controller,
            converters,
            posture,
            mu,
            reference,
            scenario,
            criterion: self.criterion,
        })
    }
}

impl Study for SlidingRange {
    type Row = Row;

    fn len(&self) -> usize {
        combinations(&self.counts())
    }

    fn row(&self, index: usize) -> Result<Row, StudyError> {
        self.row_on(index, &BuiltInPlant::new)
    }
}

impl LoopStudy for SlidingRange {
    fn row_on(&self, index: usize, plants: &impl MakePlant) -> Result<Row, StudyError> {
        self.case(index)?.row(plants)
    }
}

impl Tabular for SlidingRange {
    fn seeds(&self) -> Result<BTreeMap<String, u64>, StudyError> {
        case::noise_seeds(&self.controllers, &self.overrides)
    }
}

struct Case<'a> {
    controller: &'a ControllerChoice,
    converters: ConverterChoice,
    posture: Posture,
    mu: f64,
    reference: Reference,
    scenario: Scenario,
    criterion: Criterion,
}

impl Case<'_> {
    fn row(&self, plants: &impl MakePlant) -> Result<Row, StudyError> {
        let start_m = Trial::on(plants.make(&self.scenario)?, &self.scenario)?.tip_t_m();
        let (limit_m, limit) = self.limit_m(start_m)?;
        let targets = self.targets(start_m, limit_m);
        let trials: Vec<Result<Trialled, StudyError>> = targets
            .par_iter()
            .map(|&target| self.run(target, plants))
            .collect();
        let trials = trials.into_iter().collect::<Result<Vec<_>, _>>()?;

        let mut reached = None;
        let mut failed = None;
        let mut reached_beyond_m = None;
        for (&target, trial) in targets.iter().zip(trials) {
            match (trial, failed) {
                (Trialled::Reached { tip_t_m }, None) => reached = Some((target, tip_t_m)),
                (Trialled::Reached { .. }, Some(_)) => reached_beyond_m = Some(target),
                (Trialled::Failed(ending), None) => failed = Some((target, ending)),
                (Trialled::Failed(_), Some(_)) => {}
            }
        }
        while let (Some((near, _)), Some((far, _))) = (reached, failed)
            && (far - near).abs() > self.criterion.resolution_m
        {
            let middle = 0.5 * (near + far);
            match self.run(middle, plants)? {
                Trialled::Reached { tip_t_m } => reached = Some((middle, tip_t_m)),
                Trialled::Failed(ending) => failed = Some((middle, ending)),
            }
        }
        Ok(Row {
            controller: self.controller.clone(),
            converters: self.converters,
            posture: self.posture,
            mu: self.mu,
            reference: self.reference,
            start_m,
            z_sliding_m: reached.map(|(target, _)| target),
            limit_m,
            paper_m: printed::sliding_m(&self.scenario, self.controller, self.posture).flatten(),
            tip_t_m: reached.map(|(_, tip_t_m)| tip_t_m),
            ends_by: failed.map_or(limit, |(_, ending)| ending),
            reached_beyond_m,
        })
    }

    /// Returns the end of the interval with p > 0 ahead of the start, m, and what it is.
    fn limit_m(&self, start_m: f64) -> Result<(f64, RangeEnd), StudyError> {
        let arm = Arm::new(self.scenario.moving_arm())?;
        let line = BeltLine::new(&arm, self.posture);
        let slip = self.scenario.slip_at_rest();
        let stretches = positive_stretches(|tau| line.p_per_kg(tau, self.mu, slip));
        let around = stretches
            .into_iter()
            .find(|(from, to)| line.tip_t_m(*from) <= start_m && start_m <= line.tip_t_m(*to));
        let Some((from, to)) = around else {
            return Ok((start_m, RangeEnd::Limit));
        };
        let end = match slip {
            Slip::Positive => to,
            Slip::Negative => from,
        };
        let is_reach = end.abs() >= core::f64::consts::FRAC_PI_2;
        let limit = if is_reach {
            RangeEnd::Reach
        } else {
            RangeEnd::Limit
        };
        Ok((line.tip_t_m(end), limit))
    }

    /// Returns the targets tried first: whole multiples of the step from the start to the limit, and the limit.
    fn targets(&self, start_m: f64, limit_m: f64) -> Vec<f64> {
        let step = self.criterion.scan_step_m;
        let ahead: f64 = self.scenario.slip_at_rest().sign();
        let first = (ahead * start_m / step).floor() as i64 + 1;
        let mut targets: Vec<f64> = (first..)
            .map(|index| index as f64 * step)
            .take_while(|target| *target < ahead * limit_m)
            .map(|target| ahead * target)
            .collect();
        // Slightly less than the limit, so that the reference is within reach despite rounding.
        targets.push(limit_m - ahead * 1e-6);
        targets
    }

    fn run(&self, target_m: f64, plants: &impl MakePlant) -> Result<Trialled, StudyError> {
        let mut scenario = self.scenario.clone();
        scenario.controller.reference = self.reference.to(target_m);
        let row = || {
            format!(
                "{} {:?} at mu = {} to {target_m} m",
                self.controller, self.posture, self.mu
            )
        };
        let mut trial = Trial::on(plants.make(&scenario)?, &scenario)?;
        let mut statistics = Statistics::new(0.0);
        let criterion = &self.criterion;
        let end_s = scenario.run.enable_at_s + self.reference.duration_s();
        let mut near_since_s = None;
        while trial.time_s() < end_s + criterion.patience_s {
            trial
                .tick(&mut statistics)
                .map_err(|source| StudyError::Plant { row: row(), source })?;
            let lift_offs = match scenario.contact.kind {
                ContactKind::Rigid => statistics.lift_offs,
                // It starts without a force: the tip may bounce before it is captured.
                ContactKind::Compliant => statistics.contact.lift_offs,
            };
            if lift_offs > 0 {
                return Ok(Trialled::Failed(RangeEnd::LiftOff));
            }
            if trial.fault().is_some() {
                return Ok(Trialled::Failed(RangeEnd::Fault));
            }
            let (now_s, tip_t_m) = (trial.time_s(), trial.tip_t_m());
            if now_s < end_s || (tip_t_m - target_m).abs() > criterion.within_m {
                near_since_s = None;
            } else if now_s - *near_since_s.get_or_insert(now_s) >= criterion.stay_s {
                return Ok(Trialled::Reached { tip_t_m });
            }
        }
        Ok(Trialled::Failed(RangeEnd::NotReached))
    }
}

/// The sliding ranges of all cases.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SlidingRanges {
    /// One row per case.
    pub rows: Vec<Row>,
}

#[cfg(test)]
mod tests;

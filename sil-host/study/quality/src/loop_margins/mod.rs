//! The sampled closed loop in the frequency domain: margins along the belt.
//!
//! The loop is everything from torque to torque: arm, contact, encoders and force cell, delay, estimators, law. It is
//! opened where the torque acts: a disturbance d is added to one command, and with the sum v = d + u of disturbance and
//! controller, v/d = 1/(1 + L). The other commands stay closed. The hybrid law's commands are forces of the tip, along
//! the belt for its position and normal to it for its force; those of any other law are the torques of the joints.
//!
//! - *Linearised*: the response to a disturbance of one tick, as the difference of two runs that start in the same state
//!   with opposite disturbances, so that the estimators are part of it. It is averaged over the two turns of the
//!   controller's slow work.
//! - *Measured*: the response to sines, as the share of the command at their frequency.
//!
//! Both resolve encoders, forces and torques finely and without noise; rate, delay and lag are the scenario's. Counts add
//! noise to a loop, which has no frequency response. A rigid contact counts as known to be rigid, as it is after a short
//! time with counts.

mod at_rest;
mod figure;
mod margins;
mod options;
mod outcome;
mod response;
mod steps;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use painleve_plant::mechanics::compliant::ContactKind;
use painleve_plant::scenario::Scenario;
use painleve_shared::{Arm, Posture};
use serde::Serialize;

use painleve_plant::belt_line;
use painleve_study_core::case::{self, ControllerChoice};
use painleve_study_core::tabular::Tabular;
use painleve_study_core::{Study, StudyError, check_rows};

use at_rest::AtRest;
pub use margins::Margins;
pub use options::Options;
pub use outcome::LoopOutcome;
use response::Linearised;
pub use steps::{Curve, Step};

/// Converters that resolve finely, without noise.
const FINE: [&str; 4] = [
    "converters.encoder.bits=24",
    "converters.force.bits=22",
    "converters.force.noise_n=0",
    "converters.torque.bits=22",
];

/// A change of friction or force for the sensitivity, relative.
const CHANGE: f64 = 0.1;

/// Settings of the study: all combinations, the last varying fastest.
#[derive(Clone, Debug)]
pub struct LoopMargins {
    /// Controllers.
    pub controllers: Vec<ControllerChoice>,
    /// The side to which the elbow bends.
    pub posture: Posture,
    /// Places of the tip, m.
    pub tips_m: Vec<f64>,
    /// Number of frequencies, from 1 Hz to a fifth of the control rate.
    pub frequencies: usize,
    /// Changes to every scenario.
    pub overrides: Vec<String>,
}

/// Why there is no loop at a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum NotHeld {
    /// The tip leaves the belt.
    LiftOff,
    /// The controller latches a fault.
    Fault,
    /// The tip does not come to rest.
    Restless,
    /// Friction holds the tip: it sticks to the belt, or even a small disturbance reverses its slip.
    Sticks,
}

/// A controller that holds the tip at a place.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// The controller.
    pub controller: ControllerChoice,
    /// Where the tip is to be, m.
    pub tip_m: f64,
    /// p/Q22 there.
    pub p_ratio: f64,
    /// Q22/p there: what a normal force without acceleration is multiplied by.
    pub gain_of_contact: f64,
    /// Why the place is not held; absent if it is.
    pub not_held: Option<NotHeld>,
    /// The loops, one for each command.
    pub loops: Vec<Loop>,
    /// A step of the reference along the belt, and of a load on the tip.
    pub steps: Vec<Step>,
}

/// The loop of one command.
#[derive(Clone, Debug, Serialize)]
pub struct Loop {
    /// `position` and `force` for the hybrid law, `joint 1` and `joint 2` for another.
    pub name: &'static str,
    /// Margins of the linearised loop.
    pub margins: Margins,
    /// Changes of its modulus margin.
    pub sensitivity: Sensitivity,
    /// Its frequency response.
    pub points: Vec<Point>,
}

/// Changes of the modulus margin 1/max|S| with the conditions; absent if the place is not held then.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Sensitivity {
    /// With 10 % less friction of the belt.
    pub less_friction: Option<f64>,
    /// With 10 % more.
    pub more_friction: Option<f64>,
    /// With 10 % less normal force wanted; absent without a hybrid law.
    pub less_force: Option<f64>,
    /// With 10 % more.
    pub more_force: Option<f64>,
}

/// The open loop at one frequency.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Point {
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// Gain of the linearised loop, dB.
    pub gain_db: f64,
    /// Its phase, degrees, continued from frequency to frequency.
    pub phase_deg: f64,
    /// Gain as measured with a sine, dB.
    pub measured_gain_db: f64,
    /// Phase as measured, degrees.
    pub measured_phase_deg: f64,
}

/// A line of the table of the study.
#[derive(Debug, Serialize)]
struct Line<'a> {
    controller: &'a ControllerChoice,
    tip_m: f64,
    #[serde(rename = "loop")]
    name: &'static str,
    frequency_hz: Option<f64>,
    gain_db: Option<f64>,
    phase_deg: Option<f64>,
    measured_gain_db: Option<f64>,
    measured_phase_deg: Option<f64>,
}

impl LoopMargins {
    /// Makes every scenario, so that an error is reported before any runs.
    ///
    /// # Errors
    /// [`StudyError`] of the first invalid one.
    pub fn check(&self) -> Result<(), StudyError> {
        check_rows(self)?;
        for index in 0..self.len() {
            AtRest::start(&self.scenario(index, &[])?)?;
        }
        Ok(())
    }

    fn at(&self, index: usize) -> (&ControllerChoice, f64) {
        let places = self.tips_m.len();
        (
            &self.controllers[index / places],
            self.tips_m[index % places],
        )
    }

    /// The closed loop that holds the tip at a place, with further changes.
    fn scenario(&self, index: usize, changes: &[String]) -> Result<Scenario, StudyError> {
        let (controller, tip_m) = self.at(index);
        let overrides = FINE
            .iter()
            .map(ToString::to_string)
            .chain(self.overrides.iter().cloned())
            .chain(changes.iter().cloned());
        let overrides: Vec<String> = overrides.collect();
        let converters = controller.usual_converters();
        let mut scenario = case::scenario(controller, self.posture, converters, &overrides)?;
        // The response of the contact is estimated from what rounding to counts does to the force, which fine converters
        // do not do. With counts, the controller finds this contact rigid.
        if scenario.contact.kind == ContactKind::Rigid {
            scenario.controller.response.enabled = false;
        }
        let arm = Arm::new(scenario.arm)?;
        scenario.initial = case::at_rest_on_belt(&arm, tip_m, self.posture)?;
        scenario.controller.reference = case::Reference::Ramp(1e-3).to(tip_m);
        Ok(scenario)
    }

    /// Returns the modulus margin of a loop with a change; `None` if it cannot be made or held.
    fn modulus_with(
        &self,
        index: usize,
        number: usize,
        change: Option<String>,
    ) -> Result<Option<f64>, StudyError> {
        let Some(change) = change else {
            return Ok(None);
        };
        let scenario = self.scenario(index, &[change])?;
        let Ok(at_rest) = AtRest::settled(&scenario)? else {
            return Ok(None);
        };
        let linear = at_rest.linearised(number, response::FAST_S)?.ok();
        let of = |it: Linearised| Margins::of(|hz| it.open_loop(hz), at_rest.tick_hz()).modulus;
        Ok(linear.map(of))
    }

    fn sensitivity(
        &self,
        index: usize,
        number: usize,
        scenario: &Scenario,
        modulus: f64,
    ) -> Result<Sensitivity, StudyError> {
        let friction = scenario.belt.friction;
        let force_n = at_rest::wanted_force_n(scenario);
        let with = |key: &str, value: Option<f64>, factor: f64| {
            let change = value.map(|value| format!("{key}={:?}", value * factor));
            let changed = self.modulus_with(index, number, change)?;
            Ok::<_, StudyError>(changed.map(|changed| changed - modulus))
        };
        let (mu, force) = ("belt.friction", "controller.law.hybrid.normal_force_n");
        Ok(Sensitivity {
            less_friction: with(mu, Some(friction), 1.0 - CHANGE)?,
            more_friction: with(mu, Some(friction), 1.0 + CHANGE)?,
            less_force: with(force, force_n, 1.0 - CHANGE)?,
            more_force: with(force, force_n, 1.0 + CHANGE)?,
        })
    }
}

impl Study for LoopMargins {
    type Row = Row;

    fn len(&self) -> usize {
        painleve_study_core::combinations(&[self.controllers.len(), self.tips_m.len()])
    }

    fn row(&self, index: usize) -> Result<Row, StudyError> {
        let (controller, tip_m) = self.at(index);
        let scenario = self.scenario(index, &[])?;
        let arm = Arm::new(scenario.moving_arm())?;
        let theta = arm.link_angles_on_belt_rad(tip_m, self.posture);
        let slip = scenario.slip_at_rest();
        let p_ratio = theta.map_or(f64::NAN, |theta| {
            belt_line::p_ratio(&arm, &theta, scenario.belt.friction, slip)
        });
        let mut row = Row {
            controller: controller.clone(),
            tip_m,
            p_ratio,
            gain_of_contact: 1.0 / p_ratio,
            not_held: None,
            loops: Vec::new(),
            steps: Vec::new(),
        };
        let at_rest = match AtRest::settled(&scenario)? {
            Ok(at_rest) => at_rest,
            Err(reason) => {
                row.not_held = Some(reason);
                return Ok(row);
            }
        };
        for number in 0..2 {
            let linear = match at_rest.linearised(number, response::WHOLE_S)? {
                Ok(linear) => linear,
                Err(reason) => {
                    row.not_held = Some(reason);
                    row.loops.clear();
                    return Ok(row);
                }
            };
            if linear.is_idle() {
                continue;
            }
            let margins = Margins::of(|hz| linear.open_loop(hz), at_rest.tick_hz());
            let frequencies = response::frequencies_hz(self.frequencies, at_rest.tick_hz());
            let measured = at_rest.measured(number, &frequencies)?;
            let points = response::points(&frequencies, |hz| linear.open_loop(hz), &measured);
            row.loops.push(Loop {
                name: at_rest.name(number),
                sensitivity: self.sensitivity(index, number, &scenario, margins.modulus)?,
                margins,
                points,
            });
        }
        row.steps = steps::steps(&scenario, &at_rest, tip_m)?;
        Ok(row)
    }
}

impl Tabular for LoopMargins {
    fn lines(row: &Row) -> impl IntoIterator<Item: Serialize> {
        let line = |name, point: Option<&Point>| Line {
            controller: &row.controller,
            tip_m: row.tip_m,
            name,
            frequency_hz: point.map(|point| point.frequency_hz),
            gain_db: point.map(|point| point.gain_db),
            phase_deg: point.map(|point| point.phase_deg),
            measured_gain_db: point.map(|point| point.measured_gain_db),
            measured_phase_deg: point.map(|point| point.measured_phase_deg),
        };
        let mut lines: Vec<Line<'_>> = row
            .loops
            .iter()
            .flat_map(|one| {
                one.points
                    .iter()
                    .map(move |point| line(one.name, Some(point)))
            })
            .collect();
        if lines.is_empty() {
            lines.push(line("", None));
        }
        lines
    }

    fn seeds(&self) -> Result<BTreeMap<String, u64>, StudyError> {
        Ok(BTreeMap::new())
    }
}

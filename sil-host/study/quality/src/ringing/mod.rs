//! Where the friction observer makes a compliant contact ring, beside the stability limit.
//!
//! The paper's law with the friction observer in place of the measured friction holds the tip at rest on the moving
//! belt. The contact starts without force, so that it rings at first. In each row, p/Q22 at which this ringing no longer
//! decays is searched on the way to the edge, for one damping of the contact and one rate of the observer. Converters
//! are ideal and the friction is known; the observer is the only loop through the contact force.

mod figure;
mod limit;
mod options;
mod outcome;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use painleve_plant::belt_line::{BeltLine, positive_stretches};
use painleve_plant::scenario::Scenario;
use painleve_shared::{Arm, Posture, Slip};
use painleve_study_core::tabular::Tabular;
use painleve_study_core::trial::Trial;
use painleve_study_core::{Study, StudyError, check_rows};
use serde::Serialize;

pub use limit::ContactAtPlace;
pub use options::Options;
pub use outcome::RingingOutcome;

/// The paper's law at 10 kHz with ideal converters, without additions.
const SCENARIO: &str = "paper-gains";
/// Duration of a trial, and of its end in which the force is watched, s.
const DURATION_S: f64 = 1.0;
const WATCHED_S: f64 = 0.1;
/// Oscillation of the normal force, from mean to extreme, that counts as ringing, N.
const RINGING_N: f64 = 0.5;
/// Accuracy of the place, m.
const RESOLUTION_M: f64 = 5e-5;
/// Number of places along the belt at which p/Q22 is compared.
const PLACES: usize = 200;

/// Settings of the study: all combinations, the last varying fastest.
#[derive(Clone, Debug)]
pub struct Ringing {
    /// Stiffness of the contact, N/m.
    pub stiffness_n_m: f64,
    /// Dampings of the contact, N·s/m.
    pub dampings_ns_m: Vec<f64>,
    /// Rates λ of the friction observer, 1/s.
    pub rates_per_s: Vec<f64>,
    /// Changes to every scenario.
    pub overrides: Vec<String>,
}

/// One damping and one rate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Damping of the contact c, N·s/m.
    pub damping_ns_m: f64,
    /// Rate of the friction observer λ, 1/s.
    pub rate_per_s: f64,
    /// p/Q22 below which the contact rings; `None` if it does so nowhere on the way to the edge, or everywhere.
    pub onset_p_ratio: Option<f64>,
    /// p/Q22 of the stability limit; `None` likewise.
    pub limit_p_ratio: Option<f64>,
}

/// The way to the edge along which p/Q22 falls to zero, as τ of the belt line, or as −τ on a belt that runs along +t.
#[derive(Clone, Copy, Debug)]
struct Way {
    from: f64,
    to: f64,
}

/// Returns the direction of slip of a tip at rest, and the posture in which p/Q22 then falls slowly along half of the belt.
fn slip_and_posture(base: &Scenario) -> (Slip, Posture) {
    match base.slip_at_rest() {
        Slip::Positive => (Slip::Positive, Posture::ElbowUp),
        Slip::Negative => (Slip::Negative, Posture::ElbowDown),
    }
}

impl Ringing {
    /// Builds one trial of every contact and rate, so that an error is reported before any runs.
    ///
    /// # Errors
    /// [`StudyError`] of the first invalid one.
    pub fn check(&self) -> Result<(), StudyError> {
        check_rows(self)?;
        for index in 0..self.len() {
            let (damping_ns_m, rate_per_s) = self.at(index);
            Trial::new(&self.scenario(damping_ns_m, rate_per_s, 0.0)?)?;
        }
        self.way(&Arm::new(self.base()?.moving_arm())?, &self.base()?)?;
        Ok(())
    }

    fn at(&self, index: usize) -> (f64, f64) {
        let rates = self.rates_per_s.len();
        (
            self.dampings_ns_m[index / rates],
            self.rates_per_s[index % rates],
        )
    }

    fn base(&self) -> Result<Scenario, StudyError> {
        Ok(Scenario::load_unplaced(SCENARIO, &self.overrides)?)
    }

    /// The closed loop that holds the tip at a place (m).
    fn scenario(
        &self,
        damping_ns_m: f64,
        rate_per_s: f64,
        tip_t_m: f64,
    ) -> Result<Scenario, StudyError> {
        let base = self.base()?;
        let arm = Arm::new(base.moving_arm())?;
        let (_, posture) = slip_and_posture(&base);
        let line = BeltLine::new(&arm, posture);
        let tau = line.tau(tip_t_m).ok_or_else(|| StudyError::OutOfReach {
            tip_t_m,
            reach_m: arm.reach_on_belt_m(),
        })?;
        let theta = line.theta_rad(tau);
        let mut overrides = self.overrides.clone();
        overrides.extend([
            "contact.kind='compliant'".into(),
            format!("contact.stiffness_n_m={:?}", self.stiffness_n_m),
            format!("contact.normal={{kelvin-voigt={{damping_ns_m={damping_ns_m:?}}}}}"),
            format!("initial.theta1_deg={:?}", theta.first().to_degrees()),
            format!("initial.theta2_deg={:?}", theta.second().to_degrees()),
            format!("controller.friction.first_guess={:?}", base.belt.friction),
            "controller.law.hybrid.force_integral_gain_per_s=0".into(),
            format!(
                "controller.law.hybrid.friction={{observed={{time_constant_s={:?}}}}}",
                1.0 / rate_per_s
            ),
            format!("controller.reference=[{{ramp={{target_m={tip_t_m:?},duration_s=0.001}}}}]"),
            format!("run.duration_s={DURATION_S:?}"),
        ]);
        Ok(Scenario::load(SCENARIO, &overrides)?)
    }

    /// Returns the way to the edge on which this belt drives the tip off.
    fn way(&self, arm: &Arm<f64>, base: &Scenario) -> Result<Way, StudyError> {
        let (slip, posture) = slip_and_posture(base);
        let line = BeltLine::new(arm, posture);
        let sign: f64 = slip.sign();
        let p = |tau| line.p_per_kg(sign * tau, base.belt.friction, slip);
        let last = positive_stretches(p).pop();
        let (low, to) = last.ok_or(StudyError::NothingAdmissible)?;
        let ratio = |tau| line.p_ratio(sign * tau, base.belt.friction, slip);
        let step = (to - low) / PLACES as f64;
        let mut from = to;
        while from - step > low && ratio(from - step) > ratio(from) {
            from -= step;
        }
        Ok(Way { from, to })
    }

    /// Returns whether the contact still rings at the end of a trial, or has thrown the tip off.
    fn rings(&self, damping_ns_m: f64, rate_per_s: f64, tip_t_m: f64) -> Result<bool, StudyError> {
        let scenario = self.scenario(damping_ns_m, rate_per_s, tip_t_m)?;
        let mut trial = Trial::new(&scenario)?;
        let (mut least_n, mut most_n) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut presses = false;
        while trial.time_s() < DURATION_S {
            trial.tick(&mut ()).map_err(|source| StudyError::Plant {
                row: format!("{damping_ns_m} N·s/m, {rate_per_s} 1/s at {tip_t_m} m"),
                source,
            })?;
            let force_n = trial.normal_force_n();
            // A tip that has been thrown off may come to rest before the end.
            if presses && force_n <= 0.0 {
                return Ok(true);
            }
            presses |= force_n > 0.0;
            if trial.time_s() > DURATION_S - WATCHED_S {
                (least_n, most_n) = (least_n.min(force_n), most_n.max(force_n));
            }
        }
        Ok(!presses || most_n - least_n > 2.0 * RINGING_N)
    }
}

impl Study for Ringing {
    type Row = Row;

    fn len(&self) -> usize {
        painleve_study_core::combinations(&[self.dampings_ns_m.len(), self.rates_per_s.len()])
    }

    fn row(&self, index: usize) -> Result<Row, StudyError> {
        let (damping_ns_m, rate_per_s) = self.at(index);
        let base = self.base()?;
        let arm = Arm::new(base.moving_arm())?;
        let (slip, posture) = slip_and_posture(&base);
        let line = BeltLine::new(&arm, posture);
        let way = self.way(&arm, &base)?;
        let sign: f64 = slip.sign();
        let ratio = |tau| line.p_ratio(sign * tau, base.belt.friction, slip);
        let rings = |tau| self.rings(damping_ns_m, rate_per_s, line.tip_t_m(sign * tau));
        let contact = |tau| {
            let q22 = line.inverse_tip_inertia_per_kg(sign * tau).m22;
            ContactAtPlace {
                stiffness_n_m: self.stiffness_n_m,
                damping_ns_m,
                p_per_kg: q22 * ratio(tau),
                q22_per_kg: q22,
            }
        };
        let is_unstable = |tau| Ok(contact(tau).largest_rate_per_s() < rate_per_s);
        Ok(Row {
            damping_ns_m,
            rate_per_s,
            onset_p_ratio: border(&line, way, rings)?.map(ratio),
            limit_p_ratio: border(&line, way, is_unstable)?.map(ratio),
        })
    }
}

/// Returns τ from which on a property holds, if it holds at the end of the way only.
fn border(
    line: &BeltLine<'_>,
    way: Way,
    holds: impl Fn(f64) -> Result<bool, StudyError>,
) -> Result<Option<f64>, StudyError> {
    // Before the end, where p is zero.
    let (mut near, mut far) = (way.from, way.to - 1e-3);
    if holds(near)? || !holds(far)? {
        return Ok(None);
    }
    while (line.tip_t_m(far) - line.tip_t_m(near)).abs() > RESOLUTION_M {
        let middle = 0.5 * (near + far);
        if holds(middle)? {
            far = middle;
        } else {
            near = middle;
        }
    }
    Ok(Some(0.5 * (near + far)))
}

impl Tabular for Ringing {
    fn seeds(&self) -> Result<BTreeMap<String, u64>, StudyError> {
        Ok(BTreeMap::new())
    }
}

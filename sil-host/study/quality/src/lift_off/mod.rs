//! Lift-off: the time until the controller detects that the tip has left the belt.
//!
//! The governor is switched off and the reference goes 20 mm beyond the edge, so that p becomes
//! negative while the tip slides. Before that, the tip slides inside the edge for a while, in which every
//! loss of contact that the controller reports is a false alarm.

mod figure;
mod first_flight;
mod options;
mod outcome;

use std::collections::BTreeMap;

use first_flight::FirstFlight;
use painleve_firmware::estimate::contact::Evidence;
use painleve_firmware::refer::reference::Segment;
use painleve_plant::belt_line::admissible_m;
use painleve_plant::contact_probe::ContactProbe;
use painleve_plant::mechanics::BuiltInPlant;
use painleve_plant::mechanics::belt::BeltProfile;
use painleve_plant::scenario::Scenario;
use painleve_shared::frame::StatusFlags;
use painleve_shared::{Arm, Posture, Slip};
use painleve_study_core::case;
use painleve_study_core::loop_study::{LoopStudy, MakePlant};
use painleve_study_core::tabular::Tabular;
use painleve_study_core::trial::Trial;
use painleve_study_core::{Study, StudyError};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use serde::Serialize;

use crate::robustness::FalseAlarms;

pub use options::Options;
pub use outcome::{LiftOffs, OfEvidence};

/// Time at the start that does not count as sliding, s.
const SETTLING_S: f64 = 0.1;
/// Distance from the ends of the admissible interval while the tip slides, m.
const INSIDE_M: f64 = 0.02;
/// Distance of the reference beyond the edge, m, within the reach of the arm.
const BEYOND_M: f64 = 0.02;
const FARTHEST_M: f64 = 0.183;
/// Time after the end of the reference in which the tip may still lift off, s.
const PATIENCE_S: f64 = 1.0;
/// Time after a landing in which a detection still counts, s.
const LATE_S: f64 = 0.05;

/// Settings of the study.
#[derive(Clone, Debug)]
pub struct LiftOff {
    /// Seed of all runs.
    pub seed: u64,
    /// Number of runs with each kind of evidence.
    pub runs: usize,
    /// Sliding time before the reference leads the tip beyond the edge, s.
    pub slide_s: f64,
    /// Changes to every scenario.
    pub overrides: Vec<String>,
}

/// One run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Number of the run; it has the same disturbance with either evidence.
    pub index: usize,
    /// Sensors from which the controller decides contact.
    pub evidence: Evidence,
    /// Friction coefficient μ.
    pub mu: f64,
    /// Belt speed, m/s.
    pub v_belt_m_s: f64,
    /// Time of the first lift-off into a flight longer than the limit, otherwise of the last
    /// lift-off, s; null if the tip never left the belt.
    pub lift_off_s: Option<f64>,
    /// Time from lift-off to the next touch, s.
    pub flight_s: Option<f64>,
    /// Time from lift-off to its detection, s; null if it was not detected.
    pub noticed_s: Option<f64>,
    /// Number of times that contact was mistaken for flight while the tip slid.
    pub false_alarms: u32,
    /// Sliding time before the lift-off, s.
    pub slid_s: f64,
    /// Whether the plant could be solved to the end; otherwise the other fields describe the run
    /// until then.
    pub solved: bool,
}

/// Time limit for the detection of a lift-off, s.
fn bar_s(evidence: Evidence) -> f64 {
    match evidence {
        Evidence::ForceCell => 5e-3,
        Evidence::Encoders => 10e-3,
    }
}

impl LiftOff {
    /// Returns the evidence that the controller may use.
    const EVIDENCE: [Evidence; 2] = [Evidence::ForceCell, Evidence::Encoders];

    /// Returns the scenario of a row.
    ///
    /// # Errors
    /// [`StudyError`] if an override is invalid.
    pub fn scenario(&self, row: usize) -> Result<Scenario, StudyError> {
        let mut generator = ChaCha8Rng::seed_from_u64(self.seed);
        generator.set_stream((row / 2) as u64);
        let mut scenario = Scenario::load_unplaced("hybrid-elbow-down", &[])?;
        scenario.run.seed = generator.random::<u64>() >> 1;
        let mut draw = |from: f64, to: f64| generator.random_range(from..to);
        let friction = draw(0.5, 1.0);
        let mut sign = || if draw(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 };
        let (direction, posture) = (sign(), sign());
        let speed_m_s = direction * draw(0.1, 1.0);
        scenario.belt.friction = friction;
        scenario.belt.profile = BeltProfile::Constant { speed_m_s };
        scenario.converters.force.noise_n = 0.1;
        scenario.controller.contact.evidence = Self::EVIDENCE[row % 2];
        scenario.controller.governor.enabled = false;
        let posture = if posture > 0.0 {
            Posture::ElbowDown
        } else {
            Posture::ElbowUp
        };
        let arm = Arm::new(scenario.arm)?;
        let slip = Slip::of(-speed_m_s);
        let stretches = admissible_m(&arm, posture, friction, slip, 0.0);
        let stretch = stretches.into_iter().next().unwrap_or(0.0..0.0);
        let inside = (stretch.start + INSIDE_M, stretch.end - INSIDE_M);
        let start_m = draw(inside.0, inside.1);
        // With ż_r > 0 the paradox lies ahead at z_t > 0.
        let target_m = if direction < 0.0 {
            (stretch.end + BEYOND_M).min(FARTHEST_M)
        } else {
            (stretch.start - BEYOND_M).max(-FARTHEST_M)
        };
        let duration_s = draw(0.5, 2.0);
        let segments = &mut scenario.controller.reference.segments;
        segments.clear();
        segments.extend([
            Segment::MinimumJerk {
                target_m: draw(inside.0, inside.1) as f32,
                duration_s: self.slide_s as f32,
            },
            Segment::Ramp {
                target_m: target_m as f32,
                duration_s: duration_s as f32,
            },
        ]);
        scenario.run.duration_s = self.slide_s + duration_s + PATIENCE_S;
        scenario.initial = case::at_rest_on_belt(&arm, start_m, posture)?;
        Ok(scenario.with_overrides("lift-off", &self.overrides)?)
    }
}

impl Study for LiftOff {
    type Row = Row;

    fn len(&self) -> usize {
        painleve_study_core::combinations(&[2, self.runs])
    }

    fn row(&self, index: usize) -> Result<Row, StudyError> {
        self.row_on(index, &BuiltInPlant::new)
    }
}

impl LoopStudy for LiftOff {
    fn row_on(&self, index: usize, plants: &impl MakePlant) -> Result<Row, StudyError> {
        let scenario = self.scenario(index)?;
        let mut trial = Trial::on(plants.make(&scenario)?, &scenario)?;
        let bar_s = bar_s(scenario.controller.contact.evidence);
        let mut flight = FirstFlight::new(SETTLING_S, bar_s);
        let mut contact = ContactProbe::new(SETTLING_S, 0.0);
        let mut alarms = FalseAlarms::default();
        let mut noticed_s = None;
        let mut solved = true;
        for _ in 0..scenario.run.ticks() {
            // The controller answers the sample taken at the start of the tick.
            let sampled_s = trial.time_s();
            let flying = flight.start_s;
            if trial.tick(&mut (&mut flight, &mut contact)).is_err() {
                solved = false;
                break;
            }
            alarms.tick(&trial, &contact);
            let Some(start_s) = flying else { continue };
            if !trial.answer().flags.contains(StatusFlags::CONTACT) {
                noticed_s = Some(sampled_s - start_s);
                break;
            }
            let is_late = |end_s| sampled_s > end_s + LATE_S;
            if flight.is_over() && flight.end_s.is_some_and(is_late) {
                break;
            }
        }
        // The flight may not have ended yet.
        let patience_s = scenario.run.duration_s + LATE_S;
        while solved && flight.start_s.is_some() && flight.end_s.is_none() {
            solved = trial.tick(&mut (&mut flight, &mut contact)).is_ok();
            if trial.time_s() > patience_s {
                break;
            }
        }
        let end_s = contact.first_lift_off_s.unwrap_or(trial.time_s());
        Ok(Row {
            index: index / 2,
            evidence: scenario.controller.contact.evidence,
            mu: scenario.belt.friction,
            v_belt_m_s: scenario.belt.profile.speed_m_s(0.0),
            lift_off_s: flight.start_s,
            flight_s: flight
                .start_s
                .and_then(|start_s| flight.end_s.map(|end_s| end_s - start_s)),
            noticed_s,
            false_alarms: alarms.count,
            slid_s: (end_s - SETTLING_S).max(0.0),
            solved,
        })
    }
}

impl Tabular for LiftOff {
    fn seeds(&self) -> Result<BTreeMap<String, u64>, StudyError> {
        Ok(BTreeMap::from([("runs".into(), self.seed)]))
    }
}

#[cfg(test)]
mod tests;

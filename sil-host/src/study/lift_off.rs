//! Lift-off: how soon the controller notices that the tip has left the belt.
//!
//! The governor is switched off and the reference goes 20 mm beyond the edge, so that p turns
//! negative under a tip that slides. Before that the tip slides inside for a while, in which every
//! loss of contact that the controller reports is a false alarm.

use comfy_table::Table;
use painleve_firmware::contact_observer::Evidence;
use painleve_firmware::reference::Segment;
use painleve_shared::frame::StatusFlags;
use painleve_shared::{Arm, Posture, Slip};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use serde::Serialize;

use super::contact_watch::ContactWatch;
use super::distribution::{Percentiles, histogram};
use super::outcome::{self, Outcome};
use super::robustness::{FalseAlarms, admissible_m};
use super::trial::Trial;
use super::{Study, StudyError};
use crate::plant::belt::BeltProfile;
use crate::plant::motion::State;
use crate::plant::{Event, Observer, PlantStep};
use crate::plot::PlotError;
use crate::plot::chart::Chart;
use crate::plot::style::{BLUE_INK, ORANGE};
use crate::scenario::{InitialState, Scenario};

/// Time at the start that does not count as sliding, s.
const SETTLING_S: f64 = 0.1;
/// Distance from the ends of the admissible stretch while the tip slides, m.
const INSIDE_M: f64 = 0.02;
/// How far beyond the edge the reference goes, m, but not beyond what the arm reaches.
const BEYOND_M: f64 = 0.02;
const FARTHEST_M: f64 = 0.183;
/// Time after the reference's end in which the tip may still lift off, s.
const PATIENCE_S: f64 = 1.0;
/// How long after a landing a notice is still waited for, s.
const LATE_S: f64 = 0.05;

/// What to study.
#[derive(Clone, Debug)]
pub struct LiftOff {
    /// Seed of all runs.
    pub seed: u64,
    /// Number of runs with each kind of evidence.
    pub runs: usize,
    /// How long the tip slides before it is led over the edge, s.
    pub slide_s: f64,
    /// Changes to every scenario.
    pub overrides: Vec<String>,
}

/// One run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Its number; the same disturbance with either evidence.
    pub index: usize,
    /// From what the controller tells contact.
    pub evidence: Evidence,
    /// Friction coefficient μ.
    pub mu: f64,
    /// Belt speed, m/s.
    pub v_belt_m_s: f64,
    /// When the tip left the belt, s; none if it never did.
    pub lift_off_s: Option<f64>,
    /// Time to the first touch after it, s.
    pub flight_s: Option<f64>,
    /// Time until the controller said so, s; none if it was not noticed.
    pub noticed_s: Option<f64>,
    /// Times that contact was taken for flight while the tip slid.
    pub false_alarms: u32,
    /// Time for which the tip slid before, s.
    pub slid_s: f64,
}

/// The first flight.
#[derive(Clone, Copy, Debug, Default)]
struct FirstFlight {
    from_s: f64,
    start_s: Option<f64>,
    end_s: Option<f64>,
}

impl Observer for FirstFlight {
    fn step(&mut self, step: &PlantStep<'_>) {
        if step.start_s < self.from_s {
            return;
        }
        match (step.mode.is_contact(), self.start_s) {
            (false, None) => self.start_s = Some(step.start_s),
            (true, Some(_)) => {
                self.end_s.get_or_insert(step.start_s);
            }
            _ => {}
        }
    }

    fn event(&mut self, time_s: f64, event: Event, _: &State) {
        let touch = matches!(event, Event::Impact { .. } | Event::ImpactWithoutCollision);
        if touch && self.start_s.is_some_and(|start_s| start_s < time_s) {
            self.end_s.get_or_insert(time_s);
        }
    }
}

impl LiftOff {
    /// What the controller may go by.
    const EVIDENCE: [Evidence; 2] = [Evidence::ForceCell, Evidence::Encoders];

    /// The scenario of a row.
    ///
    /// # Errors
    /// [`StudyError`] if an override is wrong.
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
        // With ż_r > 0 the paradox is ahead at z_t > 0.
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
        let theta = arm
            .joint_angles_on_belt_rad(start_m, posture)
            .ok_or_else(|| StudyError::Option(format!("z_t = {start_m} m is out of reach")))?;
        scenario.initial = InitialState {
            theta1_deg: theta.x.to_degrees(),
            theta2_deg: theta.y.to_degrees(),
            theta1_dot_rad_s: 0.0,
            theta2_dot_rad_s: 0.0,
        };
        Ok(scenario.with_overrides("lift-off", &self.overrides)?)
    }

    /// Makes the first run, so that a wrong override is told before anything runs.
    ///
    /// # Errors
    /// [`StudyError`] if it cannot be made.
    pub fn check(&self) -> Result<(), StudyError> {
        Trial::new(&self.scenario(0)?)?;
        Ok(())
    }
}

impl Study for LiftOff {
    type Row = Row;

    fn len(&self) -> usize {
        2 * self.runs
    }

    fn row(&self, index: usize) -> Result<Row, StudyError> {
        let scenario = self.scenario(index)?;
        let mut trial = Trial::new(&scenario)?;
        let mut flight = FirstFlight {
            from_s: SETTLING_S,
            ..FirstFlight::default()
        };
        let mut watch = ContactWatch::new(SETTLING_S, 0.0);
        let mut alarms = FalseAlarms::default();
        let mut noticed_s = None;
        for _ in 0..scenario.run.ticks() {
            // The controller answers the sample at the start of the tick.
            let sampled_s = trial.time_s();
            let flying = flight.start_s;
            trial
                .tick(&mut (&mut flight, &mut watch))
                .map_err(|source| StudyError::Plant {
                    row: format!("lift-off {index}"),
                    source,
                })?;
            alarms.tick(&trial, &watch);
            let Some(start_s) = flying else { continue };
            if !trial.answer().flags.contains(StatusFlags::CONTACT) {
                noticed_s = Some(sampled_s - start_s);
                break;
            }
            if flight.end_s.is_some_and(|end_s| sampled_s > end_s + LATE_S) {
                break;
            }
        }
        // The flight may still have to end.
        while flight.start_s.is_some() && flight.end_s.is_none() && trial.time_s() < 1e4 {
            let ended = trial.tick(&mut (&mut flight, &mut watch));
            if ended.is_err() || trial.time_s() > scenario.run.duration_s + LATE_S {
                break;
            }
        }
        let end_s = flight.start_s.unwrap_or(scenario.run.duration_s);
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
            slid_s: end_s - SETTLING_S,
        })
    }
}

/// What came of one kind of evidence.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OfEvidence {
    /// From what the controller tells contact.
    pub evidence: Evidence,
    /// Within which time a lift-off shall be noticed, s.
    pub bar_s: f64,
    /// Runs in which the tip left the belt.
    pub lift_offs: usize,
    /// Those that flew for longer than the bar.
    pub long_flights: usize,
    /// Those of them that were noticed in time.
    pub in_time: usize,
    /// Those of them that were noticed never.
    pub missed: usize,
    /// Times to the notice of long flights, s.
    pub noticed_s: Option<Percentiles>,
    /// Lengths of all flights, s.
    pub flight_s: Option<Percentiles>,
    /// False alarms.
    pub false_alarms: u32,
    /// Time of sliding, h.
    pub slid_h: f64,
}

/// What came of it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LiftOffs {
    /// With the force cell, and without.
    pub evidence: Vec<OfEvidence>,
    /// All runs.
    pub rows: Vec<Row>,
}

impl Row {
    fn is_long(&self, bar_s: f64) -> bool {
        self.lift_off_s.is_some() && self.flight_s.is_none_or(|flight_s| flight_s > bar_s)
    }
}

fn bar_s(evidence: Evidence) -> f64 {
    match evidence {
        Evidence::ForceCell => 5e-3,
        Evidence::Encoders => 10e-3,
    }
}

impl LiftOffs {
    /// Of all rows.
    pub fn new(rows: Vec<Row>) -> Self {
        let evidence = LiftOff::EVIDENCE.map(|evidence| {
            let bar_s = bar_s(evidence);
            let of: Vec<&Row> = rows.iter().filter(|row| row.evidence == evidence).collect();
            let long: Vec<&&Row> = of.iter().filter(|row| row.is_long(bar_s)).collect();
            let noticed: Vec<f64> = long.iter().filter_map(|row| row.noticed_s).collect();
            OfEvidence {
                evidence,
                bar_s,
                lift_offs: of.iter().filter(|row| row.lift_off_s.is_some()).count(),
                long_flights: long.len(),
                in_time: noticed.iter().filter(|time_s| **time_s <= bar_s).count(),
                missed: long.len() - noticed.len(),
                noticed_s: Percentiles::of(noticed),
                flight_s: Percentiles::of(of.iter().filter_map(|row| row.flight_s).collect()),
                false_alarms: of.iter().map(|row| row.false_alarms).sum(),
                slid_h: of.iter().map(|row| row.slid_s).sum::<f64>() / 3600.0,
            }
        });
        Self {
            evidence: evidence.into(),
            rows,
        }
    }
}

impl Outcome for LiftOffs {
    type Line = Row;

    fn lines(&self) -> Vec<Row> {
        self.rows.clone()
    }

    fn table(&self) -> Table {
        let mut table = outcome::table([
            "evidence",
            "bar (ms)",
            "lift-offs",
            "longer than the bar",
            "in time",
            "missed",
            "median, 90, 99 %, max (ms)",
            "false alarms",
        ]);
        for of in &self.evidence {
            let times = of.noticed_s.map_or("–".into(), |times| {
                let of = [times.median, times.p90, times.p99, times.max];
                of.map(|time_s| format!("{:.2}", 1e3 * time_s)).join(", ")
            });
            table.add_row([
                outcome::name(&of.evidence),
                format!("{}", 1e3 * of.bar_s),
                of.lift_offs.to_string(),
                of.long_flights.to_string(),
                of.in_time.to_string(),
                of.missed.to_string(),
                times,
                format!("{} in {:.2} h", of.false_alarms, of.slid_h),
            ]);
        }
        table
    }

    fn svg(&self) -> Result<String, PlotError> {
        let panel = |title: &str, evidence, colour| {
            let bar_s = bar_s(evidence);
            let long = |row: &&Row| row.evidence == evidence && row.is_long(bar_s);
            let times = self.rows.iter().filter(long);
            let times: Vec<f64> = times.filter_map(|row| Some(1e3 * row.noticed_s?)).collect();
            let note = format!(
                "{} lift-offs of more than {} ms; last bar: that long or longer",
                times.len(),
                1e3 * bar_s
            );
            histogram(title, note, colour, 15.0, &times)
        };
        Chart {
            title: "How soon a lift-off is noticed".into(),
            subtitle: "led over the edge without governor; bars: 5 ms and 10 ms".into(),
            x_title: "Time from lift-off to the sample that shows it (ms)".into(),
            x: Some(0.0..15.0),
            panels: vec![
                panel("With the force cell (runs)", Evidence::ForceCell, BLUE_INK),
                panel("From the encoders (runs)", Evidence::Encoders, ORANGE),
            ],
        }
        .svg()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lift_offs_are_thrown_and_noticed_alike_on_any_number_of_threads() {
        let study = LiftOff {
            seed: 1,
            runs: 8,
            slide_s: 1.0,
            overrides: Vec::new(),
        };
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.unwrap()
                .install(|| super::super::rows(&study, || ()).unwrap())
        };
        let found = on(1);
        assert_eq!(found, on(3));
        let outcome = LiftOffs::new(found);
        for of in &outcome.evidence {
            assert!(of.lift_offs >= 4, "{}", outcome.table());
            assert!(of.in_time > 0 && of.slid_h > 0.0, "{}", outcome.table());
        }
        assert!(
            outcome
                .rows
                .iter()
                .filter_map(|row| row.noticed_s)
                .all(|time_s| time_s >= 0.0)
        );
    }

    #[test]
    fn with_its_governor_the_tip_stays_down() {
        let study = LiftOff {
            seed: 1,
            runs: 2,
            slide_s: 0.5,
            overrides: vec!["controller.governor.enabled=true".into()],
        };
        for row in super::super::rows(&study, || ()).unwrap() {
            assert_eq!((row.lift_off_s, row.noticed_s), (None, None), "{row:?}");
        }
    }
}

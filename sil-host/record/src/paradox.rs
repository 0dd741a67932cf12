//! How far a tip on the belt is from the paradox: p/Q22, and the distance to the place where p = 0.

use painleve_plant::belt_line::{BeltLine, bisected};
use painleve_plant::nalgebra::Matrix2;
use painleve_plant::scenario::Scenario;
use painleve_shared::{Arm, ArmParameters, LinkMotion, OutOfRange, Pose, Posture, Slip};

/// Intervals in which a change of sign of p along the belt is looked for.
const INTERVALS: usize = 128;
/// Fraction of the reach that is searched: at the full reach the arm is straight, and p is not known there.
const SEARCHED_REACH: f64 = 0.999_999;
/// A change of the signed friction coefficient below which the places of p = 0 stay: they move by about 0.1 m per unit.
const SAME_FRICTION: f64 = 1e-7;
/// The signed friction coefficient follows from p only where Q12 is not small beside Q22.
const LEAST_COUPLING: f64 = 1e-3;

/// Distance to the paradox at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distance {
    /// p/Q22: 1 without friction, 0 at the edge of the paradox, negative inside; NaN if p is unknown.
    pub p_ratio: f64,
    /// Distance along the belt to the nearest place with p = 0, m; 0 inside the paradox, NaN if there is no such place.
    pub edge_m: f64,
}

impl Distance {
    const UNKNOWN: Self = Self {
        p_ratio: f64::NAN,
        edge_m: f64::NAN,
    };
}

/// Measures the distance to the paradox during a run. The friction is the one that p contains, so that a friction that
/// changes during the run needs no further care.
#[derive(Clone, Debug)]
pub struct ParadoxDistance {
    free: Arms,
    /// With the payload, and the time at which the tip picks it up, s.
    loaded: Arms,
    loaded_from_s: f64,
    /// The product of slip sign and friction coefficient, the posture, and whether the arm is loaded, of these places with
    /// p = 0.
    edges: Option<(f64, Posture, bool, Vec<f64>)>,
}

/// The arm of the recorded p, and the same with the rotors of its elastic gears, whose inertia is part of the edge.
#[derive(Clone, Debug)]
struct Arms {
    recorded: Arm<f64>,
    moving: Arm<f64>,
}

impl Arms {
    fn new(scenario: &Scenario, payload_kg: f64) -> Result<Self, OutOfRange> {
        let with_payload = |mut arm: ArmParameters<f64>| {
            arm.tip_mass_kg += payload_kg;
            Arm::new(arm)
        };
        Ok(Self {
            recorded: with_payload(scenario.arm)?,
            moving: with_payload(scenario.moving_arm())?,
        })
    }
}

impl ParadoxDistance {
    /// Creates the measurement for a scenario's arm.
    ///
    /// # Errors
    /// [`OutOfRange`] if there is no such arm.
    pub fn new(scenario: &Scenario) -> Result<Self, OutOfRange> {
        let payload = &scenario.effects.payload;
        Ok(Self {
            free: Arms::new(scenario, 0.0)?,
            loaded: Arms::new(scenario, payload.mass_kg)?,
            loaded_from_s: payload.at_s,
            edges: None,
        })
    }

    /// Returns the arms at a time, s. What is recorded at the time of the payload comes before it.
    fn arms(&self, time_s: f64) -> &Arms {
        if time_s > self.loaded_from_s {
            &self.loaded
        } else {
            &self.free
        }
    }

    /// Measures at a time (s) and link angles (rad), with p in 1/kg.
    pub fn measure(&mut self, time_s: f64, theta: &LinkMotion<f64>, p_per_kg: f64) -> Distance {
        let pose = Pose::new(theta);
        let arms = self.arms(time_s);
        let q = arms.recorded.inverse_tip_inertia_per_kg(&pose);
        let mut p_ratio = p_per_kg / q.m22;
        if !p_ratio.is_finite() {
            return Distance::UNKNOWN;
        }
        let posture = Posture::of(theta);
        let tip_m = arms.moving.tip_m(&pose).x;
        if let Some(signed_friction) = signed_friction(&q, p_per_kg) {
            let q = arms.moving.inverse_tip_inertia_per_kg(&pose);
            p_ratio = 1.0 - signed_friction * q.m12 / q.m22;
            let is_loaded = time_s > self.loaded_from_s;
            let is_same = self
                .edges
                .as_ref()
                .is_some_and(|(known, of_posture, was_loaded, _)| {
                    (known - signed_friction).abs() < SAME_FRICTION
                        && (*of_posture, *was_loaded) == (posture, is_loaded)
                });
            if !is_same {
                let edges = edges_m(&arms.moving, signed_friction, posture);
                self.edges = Some((signed_friction, posture, is_loaded, edges));
            }
        }
        let edges = self.edges.iter().flat_map(|(.., edges)| edges);
        let nearest_m = edges.map(|edge| (edge - tip_m).abs()).reduce(f64::min);
        Distance {
            p_ratio,
            edge_m: match nearest_m {
                _ if p_ratio <= 0.0 => 0.0,
                Some(distance_m) => distance_m,
                None => f64::NAN,
            },
        }
    }

    /// Returns how far a tip that is held back at a time (s) and link angles (rad), with p in 1/kg, is before the edge p = 0
    /// that is next in the direction of this sign, m; 0 inside the paradox. `None` if there is no such edge: the tip is held by
    /// another limit.
    pub fn before_edge_m(
        &self,
        time_s: f64,
        theta: &LinkMotion<f64>,
        p_per_kg: f64,
        direction: f64,
    ) -> Option<f64> {
        let pose = Pose::new(theta);
        let Arms { recorded, moving } = self.arms(time_s);
        let q = recorded.inverse_tip_inertia_per_kg(&pose);
        let friction = signed_friction(&q, p_per_kg)?;
        let line = BeltLine::new(moving, Posture::of(theta));
        let tip_m = moving.tip_m(&pose).x;
        line.before_edge_m(tip_m, direction, friction.abs(), Slip::of(friction))
            .map(|distance_m| distance_m.max(0.0))
    }
}

/// Returns the places on the belt with p = 0, m.
fn edges_m(arm: &Arm<f64>, signed_friction: f64, posture: Posture) -> Vec<f64> {
    let reach_m = SEARCHED_REACH * arm.reach_on_belt_m();
    let p = |tip_m: f64| {
        let row = arm.inverse_inertia_row_on_belt(tip_m, posture);
        row.map_or(f64::NAN, |row| row.q22 - signed_friction * row.q12)
    };
    let at = |number: usize| reach_m * (2.0 * number as f64 / INTERVALS as f64 - 1.0);
    let crossing = |number: usize| {
        let (low, high) = (at(number), at(number + 1));
        let sign = p(low).signum();
        if sign * p(high) > 0.0 || p(high).is_nan() {
            return None;
        }
        Some(bisected(low, high, |tip_m| sign * p(tip_m) > 0.0))
    };
    (0..INTERVALS).filter_map(crossing).collect()
}

/// Returns the product of slip sign and friction coefficient that p contains; `None` where it hardly depends on friction.
fn signed_friction(q: &Matrix2<f64>, p_per_kg: f64) -> Option<f64> {
    let is_coupled = p_per_kg.is_finite() && q.m12.abs() > LEAST_COUPLING * q.m22;
    is_coupled.then(|| (q.m22 - p_per_kg) / q.m12)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Puts the tip of the paper's arm on the belt, and returns link angles and p.
    fn placed(
        tip_m: f64,
        posture: Posture,
        friction: f64,
    ) -> (ParadoxDistance, LinkMotion<f64>, f64) {
        let distance = ParadoxDistance::new(&Scenario::default()).unwrap();
        let arm = &distance.free.moving;
        let theta = arm.link_angles_on_belt_rad(tip_m, posture).unwrap();
        let p = arm.p_per_kg(&Pose::new(&theta), friction, Slip::Positive);
        (distance, theta, p)
    }

    /// Measures with the tip on the belt.
    fn at(tip_m: f64, friction: f64) -> Distance {
        let (mut distance, theta, p) = placed(tip_m, Posture::ElbowDown, friction);
        distance.measure(0.0, &theta, p)
    }

    #[test]
    fn the_edge_of_the_papers_arm_is_where_the_scenarios_say() {
        // `edge.toml`: elbow down, p = 0 at 0.16471 m for μ = 0.6.
        let held = at(0.163, 0.6);
        assert!((held.edge_m - 0.00171).abs() < 1e-5, "{held:?}");
        assert!(held.p_ratio > 0.0 && held.p_ratio < 0.12, "{held:?}");
        let inside = at(0.17, 0.6);
        assert!(inside.p_ratio < 0.0 && inside.edge_m == 0.0, "{inside:?}");
        let without = at(0.1, 0.05);
        assert!(
            without.edge_m.is_nan() && without.p_ratio > 0.5,
            "{without:?}"
        );
    }

    #[test]
    fn an_edge_behind_the_tip_does_not_hold_it_and_one_at_the_end_of_the_reach_does() {
        let (distance, theta, p) = placed(-0.039, Posture::ElbowUp, 0.95);
        assert_eq!(distance.before_edge_m(0.0, &theta, p, -1.0), None);
        assert!(distance.before_edge_m(0.0, &theta, p, 1.0).unwrap() > 0.2);
        // For μ = 0.6, elbow up, p = 0 at 0.18269 m: in the last hundredth of the reach.
        let (mut distance, theta, p) = placed(0.182, Posture::ElbowUp, 0.6);
        let before_m = distance.before_edge_m(0.0, &theta, p, 1.0).unwrap();
        assert!((before_m - 0.00069).abs() < 1e-5, "{before_m}");
        let nearest_m = distance.measure(0.0, &theta, p).edge_m;
        assert!((nearest_m - before_m).abs() < 1e-9, "{nearest_m}");
        let (distance, theta, p) = placed(0.17, Posture::ElbowDown, 0.6);
        assert_eq!(distance.before_edge_m(0.0, &theta, p, 1.0), Some(0.0));
    }

    /// The recorded p is that of the arm with its payload and without the rotors of its gears.
    #[test]
    fn a_payload_and_the_rotors_of_elastic_gears_move_the_edge() {
        let changes = [
            "contact.kind='compliant'",
            "effects.payload.mass_kg=0.02",
            "effects.gear.elastic=true",
        ];
        let scenario = Scenario::load("edge", &changes.map(str::to_owned)).unwrap();
        let mut distance = ParadoxDistance::new(&scenario).unwrap();
        for (time_s, payload_kg) in [(0.5, 0.0), (1.5, 0.02)] {
            let mut moving = scenario.moving_arm();
            moving.tip_mass_kg += payload_kg;
            let recorded = ArmParameters {
                rotor_inertia_kg_m2: scenario.arm.rotor_inertia_kg_m2,
                ..moving
            };
            let [moving, recorded] = [moving, recorded].map(|arm| Arm::new(arm).unwrap());
            let line = BeltLine::new(&moving, Posture::ElbowDown);
            let theta = line.theta_rad(line.tau(0.15).unwrap());
            let p = recorded.p_per_kg(&Pose::new(&theta), 0.6, Slip::Positive);
            let expected_m = line.before_edge_m(0.15, 1.0, 0.6, Slip::Positive).unwrap();
            let before_m = distance.before_edge_m(time_s, &theta, p, 1.0).unwrap();
            let measured = distance.measure(time_s, &theta, p);
            assert!(
                (before_m - expected_m).abs() < 1e-6,
                "{time_s}: {before_m}, {expected_m}"
            );
            assert!(
                (measured.edge_m - expected_m).abs() < 1e-6,
                "{time_s}: {measured:?}"
            );
            let p_ratio = line.p_ratio(line.tau(0.15).unwrap(), 0.6, Slip::Positive);
            assert!(
                (measured.p_ratio - p_ratio).abs() < 1e-9,
                "{time_s}: {measured:?}"
            );
        }
    }

    #[test]
    fn an_unknown_p_has_no_distance() {
        let mut distance = ParadoxDistance::new(&Scenario::default()).unwrap();
        let unknown = distance.measure(0.0, &LinkMotion::new(0.1, -0.5), f64::NAN);
        assert!(unknown.p_ratio.is_nan() && unknown.edge_m.is_nan());
    }
}

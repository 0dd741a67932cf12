//! Returns a tip that has left the belt to it, softly and within the admissible stretch.
//!
//! In the air the links are double integrators (computed torque) that follow a tip path: above the
//! belt to the admissible stretch, then down, slower at lower heights, until the tip touches and the
//! law resumes. The path is followed in link angles, because a thrown arm may swing through the
//! straight posture, where some tip accelerations are impossible. A tip at rest lands with the belt's
//! full slip, in the direction for which the stretch is admissible.

use nalgebra::Vector2;
use painleve_shared::{Arm, LinkMotion, Posture, Real, settings};

use crate::estimate::belt::BOUND_ERROR_M_S;
use crate::estimate::model::Model;
use crate::estimate::response::SETTLING_S;
use crate::law::LawOutput;
use crate::refer::governor::{NEAR_M, Stretch, USABLE_REACH};

/// Height above the belt at which the tip moves along it, m.
const CLEARANCE_M: f32 = 0.5 * NEAR_M;
/// Rate of the path's slow changes, as a part of the bandwidth of the motion: at which its height above the belt decays, the landing
/// point moves inwards while the path is out of reach, and the path moves on while friction of the joints holds the tip short of its
/// landing point. Lowered at four times of it, fewer captures on compliant belts succeeded (lab book, *Constants, once more*).
const PATH_RATE: f32 = 0.25;
/// Farthest path beyond where the tip should land, m: below the belt until contact is detected, and along it where friction of
/// the joints holds the tip. Of a depth from 3 mm on, no campaign shows a difference (lab book, *Constants, once more*), but an
/// arm whose links are 5 % shorter than assumed needs more than 20 mm.
const FARTHEST_M: f32 = 0.03;
/// Factor on the landing speed below the assumed belt: a tip that gets there shows that the links are shorter. Slower, fewer captures
/// succeeded (lab book, *Constants that are not needed*); as fast there as at the same height above it, and with a path raised at
/// once, more runs were lost (lab book, *Captures of an arm that is not known*).
const SEARCHING: f32 = 4.0;
/// Speed at which the landing point moves along the belt to the admissible stretch, m/s. At once, a tip was thrown along the
/// belt (lab book, *The way to the landing point*).
const TRAVEL_M_S: f32 = 0.5;

settings! {
    /// Settings of the recovery.
    #[derive(Copy)]
    pub struct RecoverySettings {
        /// Bandwidth of the motion in the air.
        bandwidth_rad_s: f32 = 60.0, 1.0..=1e3, "rad/s";
        /// Largest acceleration in the air: the norm of both links'.
        acceleration_rad_s2: f32 = 500.0, 1.0..=1e5, "rad/s²";
        /// Speed at which the tip is lowered onto the belt.
        landing_speed_m_s: f32 = 0.02, 1e-3..=1.0, "m/s";
        /// Least p/Q22 at the landing point: closer to the edge, impacts throw the tip off.
        minimum_p_ratio: f32 = 0.2, 0.0..=0.9;
    }
}

/// State of a recovery, from where the tip leaves the belt until it has landed.
#[derive(Clone, Copy, Debug)]
pub struct Flight {
    /// Landing point, m.
    landing_m: f32,
    /// Height of the path above the belt, m.
    height_m: f32,
    /// How far the path goes beyond the landing point, m.
    beyond_m: f32,
    /// Whether the tip has been above its landing point. It then descends there, even if the first
    /// touch drags it along.
    lands: bool,
    /// Posture in which the tip is to land.
    pub posture: Posture,
    /// Link angles of the path at the previous tick, rad.
    path_rad: Option<LinkMotion<f32>>,
    /// Duration of the present contact, s.
    touched_s: f32,
}

impl Flight {
    /// Records a tick of `tick_s` (s) in contact. Returns whether the tip has landed: a tip that bounces off earlier
    /// continues its descent.
    pub fn touch(&mut self, tick_s: f32) -> bool {
        self.path_rad = None;
        self.touched_s += tick_s;
        self.touched_s > SETTLING_S
    }
}

impl RecoverySettings {
    /// Computes the torques for one tick of `tick_s` (s) in the air, with the admissible `stretch`; until it
    /// is known the tip is held above the belt.
    #[inline(never)]
    pub fn tick(
        &self,
        flight: &mut Option<Flight>,
        arm: &Arm<f32>,
        model: &Model,
        stretch: Option<Stretch>,
        tick_s: f32,
    ) -> LawOutput {
        let flight = flight.get_or_insert(Flight {
            landing_m: model.tip_m.x,
            height_m: model.gap_m.at_least(0.0),
            beyond_m: 0.0,
            lands: false,
            posture: Posture::of(&model.theta_rad),
            path_rad: None,
            touched_s: 0.0,
        });
        flight.touched_s = 0.0;
        let part = (PATH_RATE * self.bandwidth_rad_s * tick_s).at_most(1.0);
        // Where the belt is higher than assumed, the tip rests on it on its way: it may land there, too.
        let waits = !flight.lands && flight.height_m == CLEARANCE_M;
        let rests = waits && model.tip_velocity_m_s.x.abs() < BOUND_ERROR_M_S;
        if rests {
            flight.landing_m = model.tip_m.x;
        }
        let mut away = flight.landing_m - model.tip_m.x;
        flight.lands = stretch.is_some_and(|Stretch { lower_m, upper_m }| {
            let place_m = flight.landing_m.limited(lower_m, upper_m);
            flight.landing_m += (place_m - flight.landing_m).within(TRAVEL_M_S * tick_s);
            let tip_m = model.tip_m.x;
            away = place_m - tip_m;
            away.abs() < NEAR_M || (flight.lands && tip_m > lower_m && tip_m < upper_m)
        });
        if rests {
            flight.beyond_m = (flight.beyond_m + part * away).within(FARTHEST_M);
        }
        // Descend faster at greater height, and at landing speed close to the belt.
        let least_m = self.landing_speed_m_s * tick_s;
        let down_m = if flight.height_m < 0.0 {
            SEARCHING * least_m
        } else {
            least_m + part * flight.height_m
        };
        let lowest_m = flight.height_m - down_m;
        flight.height_m = if flight.lands {
            lowest_m.at_least(-FARTHEST_M)
        } else {
            CLEARANCE_M.at_least(lowest_m)
        };
        let wanted_m = Vector2::new(
            flight.landing_m + flight.beyond_m,
            flight.height_m - arm.height_m(),
        );
        // A path below the belt ends at the arm's reach, most of all once the links have been found shorter. Further
        // inwards it gets deeper and presses.
        let distance_m = wanted_m.norm_squared().square_root();
        let excess = (distance_m / (USABLE_REACH * arm.reach_m())).at_least(1.0);
        if excess > 1.0 {
            flight.landing_m *= 1.0 - part;
        }
        let path_rad = arm
            .link_angles_rad(&(wanted_m / excess), flight.posture)
            .or(flight.path_rad)
            .unwrap_or(model.theta_rad);
        let path_rate_rad_s = (path_rad - flight.path_rad.unwrap_or(path_rad)) / tick_s;
        flight.path_rad = Some(path_rad);

        let bandwidth = self.bandwidth_rad_s;
        let wanted = (path_rad - model.theta_rad) * (bandwidth * bandwidth)
            + (path_rate_rad_s - model.theta_dot_rad_s) * (2.0 * bandwidth);
        let size = wanted.vector().norm_squared().square_root();
        let scale = self.acceleration_rad_s2 / size.at_least(self.acceleration_rad_s2);
        LawOutput {
            torque_nm: model.inverse_dynamics_in_air_nm(&(wanted * scale)),
            contact_force_n: Vector2::zeros(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use painleve_shared::{ArmParameters, GeneralisedTorque, JointTorque};
    use proptest::prelude::*;

    /// Returns an arm, and its model with the tip on the belt at 0.1 m and the links turning at these rates.
    fn at_a_tenth_of_a_metre(theta_dot_rad_s: LinkMotion<f32>) -> (Arm<f32>, Model) {
        let arm = Arm::new(ArmParameters::default()).unwrap();
        let theta_rad = arm
            .link_angles_on_belt_rad(0.1, Posture::ElbowDown)
            .unwrap();
        let still = GeneralisedTorque::zeros();
        (arm, Model::new(&arm, theta_rad, theta_dot_rad_s, &still))
    }

    #[test]
    fn only_a_contact_that_lasts_ends_a_recovery() {
        let (arm, model) = at_a_tenth_of_a_metre(LinkMotion::zeros());
        let recovery = RecoverySettings::default();
        let mut state = None;
        for _ in 0..10 {
            recovery.tick(&mut state, &arm, &model, None, 1e-3);
            let flight: &mut Flight = state.as_mut().unwrap();
            assert!((0..40).all(|_| !flight.touch(1e-3)));
            assert_eq!(flight.posture, Posture::ElbowDown);
        }
        assert!((0..11).any(|_| state.as_mut().unwrap().touch(1e-3)));
    }

    #[test]
    fn the_way_to_a_far_landing_point_is_slow() {
        let (arm, model) = at_a_tenth_of_a_metre(LinkMotion::new(0.3, 0.3));
        let stretch = Stretch {
            lower_m: -0.1,
            upper_m: -0.05,
        };
        let mut flight = None;
        let mut moved_m = 0.0;
        for tick in 1..=100_u16 {
            RecoverySettings::default().tick(&mut flight, &arm, &model, Some(stretch), 1e-3);
            moved_m = 0.1 - flight.unwrap().landing_m;
            assert!(moved_m < 5.1e-4 * f32::from(tick), "{tick}: {moved_m}");
        }
        assert!(moved_m > 0.045, "{moved_m}");
    }

    /// Returns the acceleration (m/s²) with which the recovery presses the tip down after `ticks` in which the belt
    /// holds it at `tip_t_m` and `gap_m`, and the landing point, m.
    fn held(length_m: f32, landing_m: f32, tip_t_m: f32, gap_m: f32, ticks: u32) -> (f32, f32) {
        let arm = Arm::<f32>::new(ArmParameters {
            link_length_m: [length_m; 2],
            ..Default::default()
        })
        .unwrap();
        let posture = Posture::ElbowDown;
        let tip_m = Vector2::new(tip_t_m, gap_m - arm.height_m());
        let theta = arm.link_angles_rad(&tip_m, posture).unwrap();
        let torque = GeneralisedTorque::zeros();
        let model = Model::new(&arm, theta, LinkMotion::zeros(), &torque);
        let recovery = RecoverySettings::default();
        let mut state = Some(Flight {
            landing_m,
            height_m: gap_m,
            beyond_m: 0.0,
            lands: gap_m <= 0.0,
            posture,
            path_rad: None,
            touched_s: 0.0,
        });
        let stretch = Some(Stretch {
            lower_m: -0.15,
            upper_m: 0.15,
        });
        let torque = (0..ticks)
            .map(|_| {
                recovery
                    .tick(&mut state, &arm, &model, stretch, 1e-3)
                    .torque_nm
            })
            .last()
            .unwrap();
        let acceleration = model.free_acceleration_rad_s2(&torque);
        let down = -(model.jacobian * acceleration.vector()).y;
        (down, state.unwrap().landing_m)
    }

    #[test]
    fn a_path_out_of_reach_presses_the_tip_down_nevertheless() {
        // At 0.2035 m a depth of 3 mm is out of reach at -0.144 m.
        let (down, landing) = held(0.2035, -0.144, -0.1405, 0.0, 400);
        assert!(down > 3.0 && landing > -0.14, "{down} {landing}");
        let (down, landing) = held(0.22, -0.144, -0.1405, 0.0, 400);
        assert!(down > 3.0 && landing == -0.144, "{down} {landing}");
    }

    #[test]
    fn a_tip_at_rest_on_a_belt_higher_than_assumed_lands_there() {
        let (down, landing) = held(0.21, -0.04, -0.035, 0.003, 400);
        assert!(
            down > 3.0 && (landing + 0.035).abs() < 1e-6,
            "{down} {landing}"
        );
    }

    /// Coulomb friction of the joints holds the tip 5 mm away from the only place to land.
    #[test]
    fn a_tip_that_friction_of_the_joints_holds_short_of_its_landing_point_gets_there() {
        const FRICTION_NM: f32 = 0.3;
        const STEPS: u32 = 200;
        let arm = Arm::<f32>::new(ArmParameters::default()).unwrap();
        let tip_m = Vector2::new(-0.1065, CLEARANCE_M - arm.height_m());
        let there = arm.link_angles_rad(&tip_m, Posture::ElbowDown).unwrap();
        let mut theta = there + LinkMotion::new(0.0, 0.03);
        let mut theta_dot = LinkMotion::zeros();
        let recovery = RecoverySettings::default();
        let mut state = None;
        let stretch = Some(Stretch {
            lower_m: tip_m.x,
            upper_m: tip_m.x,
        });
        let model_of = |theta, theta_dot, friction_nm: JointTorque<f32>| {
            Model::new(&arm, theta, theta_dot, &friction_nm.to_links())
        };
        let lands_at_m = (0..1000).find_map(|_| {
            let known = model_of(theta, theta_dot, JointTorque::zeros());
            let torque = recovery.tick(&mut state, &arm, &known, stretch, 1e-3);
            for _ in 0..STEPS {
                let friction_nm = theta_dot
                    .to_joints()
                    .to_array()
                    .map(|rate_rad_s| -FRICTION_NM * (rate_rad_s / 2e-3).limited(-1.0, 1.0));
                let friction_nm = JointTorque::from_array(friction_nm);
                let model = model_of(theta, theta_dot, friction_nm);
                let step_s = 1e-3 / STEPS as f32;
                theta_dot += model.free_acceleration_rad_s2(&torque.torque_nm) * step_s;
                theta += theta_dot * step_s;
            }
            state
                .is_some_and(|flight: Flight| flight.lands)
                .then_some(known.tip_m.x)
        });
        assert!(lands_at_m.is_some_and(|place_m| (place_m - tip_m.x).abs() < NEAR_M));
    }

    proptest! {
        /// A free arm, integrated in small steps, comes down within the stretch, slowly.
        #[test]
        fn a_thrown_tip_lands_softly_where_it_may(
            tip in 0.05_f32..0.165, height in 0.005_f32..0.01, w1 in -0.3_f32..0.3, w2 in -0.3_f32..0.3,
            up: bool,
        ) {
            let arm = Arm::<f32>::new(ArmParameters::default()).unwrap();
            let posture = if up { Posture::ElbowUp } else { Posture::ElbowDown };
            let at = Vector2::new(tip, height - arm.height_m());
            let mut theta = arm.link_angles_rad(&at, posture).unwrap();
            let mut theta_dot = LinkMotion::new(w1, w2);
            let recovery = RecoverySettings::default();
            let mut state = None;
            let stretch = Stretch { lower_m: -0.18, upper_m: 0.155 };
            let landing = (0..1000).find_map(|_| {
                let model = Model::new(&arm, theta, theta_dot, &GeneralisedTorque::zeros());
                let torque = recovery.tick(&mut state, &arm, &model, Some(stretch), 1e-3).torque_nm;
                for _ in 0..10 {
                    let model = Model::new(&arm, theta, theta_dot, &GeneralisedTorque::zeros());
                    theta_dot += model.free_acceleration_rad_s2(&torque) * 1e-4;
                    theta += theta_dot * 1e-4;
                }
                let model = Model::new(&arm, theta, theta_dot, &GeneralisedTorque::zeros());
                let down = model.gap_m < 0.0 && state.is_some_and(|flight: Flight| flight.lands);
                down.then_some(model)
            });
            let model = landing.unwrap();
            prop_assert!(model.tip_m.x < 0.16 && model.tip_m.x > -0.18, "{}", model.tip_m);
            prop_assert!(model.tip_velocity_m_s.y.abs() < 0.06, "{}", model.tip_velocity_m_s);
        }
    }
}

//! Checks encoders and force cell against each other: the belt is where the model says.
//!
//! A tip deep inside the belt, or a force on a tip far above it, cannot be: an encoder is frozen at a plausible
//! angle, slips on its shaft or is zeroed wrongly, or the force cell is.
//!
//! Nor can a tip rest near the belt without a force on it: it falls, or the drive presses it down. Then the force
//! cell or its line is dead and reads zero, or both encoders are frozen.

use painleve_shared::counts::{EncoderCounts, EncoderScale, ForceCounts, LinearScale};
use painleve_shared::kinematics::Pose;
use painleve_shared::{Arm, JointMotion};

/// Largest error of the height of the tip, as a part of the height of the arm's base over the belt: errors of
/// the links' lengths and of the encoders' zeros stay below.
const HEIGHT_TOLERANCE: f32 = 0.05;

/// Smallest force that counts as contact, as a part of the force cell's range.
const FORCE_TOLERANCE: f32 = 0.05;

/// Largest force on a tip in the air, as a part of the force cell's range.
const NO_FORCE: f32 = 0.005;

/// Largest change of the height of a tip at rest, as a part of the height of the arm's base over the belt. A
/// tip that is thrown upwards stays within it for some 30 ms.
const REST_TOLERANCE: f32 = 0.002;

/// Time for which a tip may rest near the belt without a force, s.
const REST_LIMIT_S: f32 = 0.2;

/// Model and scalings of an arm on its belt.
#[derive(Clone, Debug)]
pub struct GapCheck {
    arm: Arm<f32>,
    encoders: [EncoderScale; 2],
    /// One count of each encoder, rad.
    rad_per_count: [f32; 2],
    force: LinearScale<f32>,
    /// Ticks for which a tip may rest near the belt without a force.
    rest_limit_ticks: u32,
    /// Ticks for which it has, and its height over the belt at the first of them, m.
    rest_ticks: u32,
    rest_gap_m: f32,
}

impl GapCheck {
    /// Makes a check of this arm, for `tick_hz` readings a second.
    pub fn new(
        arm: Arm<f32>,
        encoders: [EncoderScale; 2],
        force: LinearScale<f32>,
        tick_hz: f32,
    ) -> Self {
        Self {
            arm,
            encoders,
            rad_per_count: encoders.map(|scale| scale.rad_per_count()),
            force,
            rest_limit_ticks: (REST_LIMIT_S * tick_hz) as u32,
            rest_ticks: 0,
            rest_gap_m: 0.0,
        }
    }

    /// Returns whether the readings of this tick contradict each other, or those before. A tip may rest without a
    /// force while the drive is not active: somebody may hold the arm.
    pub fn contradicts(
        &mut self,
        joints: [EncoderCounts; 2],
        normal_force: ForceCounts,
        is_active: bool,
    ) -> bool {
        let [scale_1, scale_2] = &self.encoders;
        let [rad_1, rad_2] = self.rad_per_count;
        let [joint_1, joint_2] = joints;
        let joints = JointMotion::new(
            scale_1.counts_from_zero(joint_1) as f32 * rad_1,
            scale_2.counts_from_zero(joint_2) as f32 * rad_2,
        );
        let gap_m = self.arm.gap_m(&Pose::new(&joints.to_links()));
        let tolerance_m = HEIGHT_TOLERANCE * self.arm.height_m();
        let force_n = self.force.value(normal_force.0);
        let touches = force_n > FORCE_TOLERANCE * self.force.range;
        let rests = is_active
            && force_n < NO_FORCE * self.force.range
            && gap_m < tolerance_m
            && (gap_m - self.rest_gap_m).abs() < REST_TOLERANCE * self.arm.height_m();
        self.rest_ticks = if rests {
            self.rest_ticks.saturating_add(1)
        } else {
            self.rest_gap_m = gap_m;
            0
        };
        let is_dead = self.rest_ticks > self.rest_limit_ticks;
        gap_m < -tolerance_m || touches && gap_m > tolerance_m || is_dead
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use painleve_shared::ArmParameters;

    fn contradicts(degrees: [f64; 2], force_n: f32) -> bool {
        let scale = EncoderScale::default();
        let force = LinearScale {
            bits: 13,
            range: 20.0,
        };
        let arm = Arm::new(ArmParameters::default()).expect("the paper's arm");
        let mut check = GapCheck::new(arm, [scale; 2], force, 1000.0);
        let [theta_1, theta_2] = degrees.map(f64::to_radians);
        let joints = [scale.reading(theta_1), scale.reading(theta_2 - theta_1)];
        check.contradicts(joints, ForceCounts(force.counts(force_n).0), true)
    }

    /// Returns the tick, of 1 kHz, at which a tip that rests on the belt for a second is found implausible.
    fn found_at(force_n: f32, is_active: bool) -> Option<u32> {
        let scale = EncoderScale::default();
        let force = LinearScale {
            bits: 13,
            range: 20.0,
        };
        let arm = Arm::new(ArmParameters::default()).expect("the paper's arm");
        let mut check = GapCheck::new(arm, [scale; 2], force, 1000.0);
        let [theta_1, theta_2] = ON_BELT.map(f64::to_radians);
        let joints = [scale.reading(theta_1), scale.reading(theta_2 - theta_1)];
        let counts = ForceCounts(force.counts(force_n).0);
        (0..1000).find(|_| check.contradicts(joints, counts, is_active))
    }

    #[test]
    fn a_driven_tip_that_rests_on_the_belt_without_a_force_is_not_plausible() {
        assert_eq!(found_at(0.0, true), Some(200));
        assert_eq!(found_at(0.0, false), None);
        assert_eq!(found_at(0.5, true), None);
    }

    /// x0,d of the paper: the tip is on the belt.
    const ON_BELT: [f64; 2] = [-11.4, -35.1];

    #[test]
    fn a_tip_on_the_belt_and_a_tip_in_the_air_are_plausible() {
        assert!(!contradicts(ON_BELT, 10.0));
        assert!(!contradicts(ON_BELT, 0.0));
        assert!(!contradicts([-40.0, -60.0], 0.0));
    }

    #[test]
    fn a_tip_inside_the_belt_or_pressed_in_the_air_is_not() {
        assert!(contradicts([0.0, -10.0], 10.0));
        assert!(contradicts([0.0, -10.0], 0.0));
        assert!(contradicts([-40.0, -60.0], 10.0));
    }
}

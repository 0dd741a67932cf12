//! Checks encoders and force cell against each other: the belt is where the model says.
//!
//! A tip deep inside the belt, or a force on a tip far above it, cannot be: an encoder is frozen at a plausible
//! angle, slips on its shaft or is zeroed wrongly, or the force cell is.

use painleve_shared::counts::{EncoderCounts, EncoderScale, ForceCounts, LinearScale};
use painleve_shared::kinematics::Pose;
use painleve_shared::{Arm, JointMotion};

/// Largest error of the height of the tip, as a part of the height of the arm's base over the belt: errors of
/// the links' lengths and of the encoders' zeros stay below.
const HEIGHT_TOLERANCE: f32 = 0.05;

/// Smallest force that counts as contact, as a part of the force cell's range.
const FORCE_TOLERANCE: f32 = 0.05;

/// Model and scalings of an arm on its belt.
#[derive(Clone, Debug)]
pub struct GapCheck {
    arm: Arm<f32>,
    encoders: [EncoderScale; 2],
    /// One count of each encoder, rad.
    rad_per_count: [f32; 2],
    force: LinearScale<f32>,
}

impl GapCheck {
    /// Makes a check of this arm.
    pub fn new(arm: Arm<f32>, encoders: [EncoderScale; 2], force: LinearScale<f32>) -> Self {
        Self {
            arm,
            encoders,
            rad_per_count: encoders.map(|scale| scale.rad_per_count()),
            force,
        }
    }

    /// Returns whether these readings contradict each other.
    pub fn contradicts(&self, joints: [EncoderCounts; 2], normal_force: ForceCounts) -> bool {
        let [scale_1, scale_2] = &self.encoders;
        let [rad_1, rad_2] = self.rad_per_count;
        let [joint_1, joint_2] = joints;
        let joints = JointMotion::new(
            scale_1.counts_from_zero(joint_1) as f32 * rad_1,
            scale_2.counts_from_zero(joint_2) as f32 * rad_2,
        );
        let gap_m = self.arm.gap_m(&Pose::new(&joints.to_links()));
        let tolerance_m = HEIGHT_TOLERANCE * self.arm.height_m();
        let touches = self.force.value(normal_force.0) > FORCE_TOLERANCE * self.force.range;
        gap_m < -tolerance_m || touches && gap_m > tolerance_m
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
        let check = GapCheck::new(arm, [scale; 2], force);
        let [theta_1, theta_2] = degrees.map(f64::to_radians);
        let joints = [scale.reading(theta_1), scale.reading(theta_2 - theta_1)];
        check.contradicts(joints, ForceCounts(force.counts(force_n).0))
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

//! Allocates the torque, in the order of importance: the least normal force, the motion along the belt, the rest of the
//! normal force.

use painleve_shared::{JointTorque, Real};

use crate::estimate::model::Model;

/// Torques of the motion and part of the normal force that the torque limits allow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Allocation {
    /// Joint torques of the motion along the belt, N·m.
    pub motion_nm: JointTorque<f32>,
    /// Part of the desired contact force, at least the least one.
    pub pressing: f32,
    /// Whether the motion is slower than desired.
    pub slows: bool,
}

impl Allocation {
    /// Allocates up to ±`limit_nm` of each joint to a motion with these joint torques and to the torques that press the tip
    /// on the belt, of which the part `least` comes first.
    #[inline]
    pub fn new(
        model: &Model,
        motion_nm: JointTorque<f32>,
        pressing_nm: &JointTorque<f32>,
        limit_nm: f32,
        least: f32,
    ) -> Self {
        let fits =
            |nm: JointTorque<f32>| nm.first().abs() <= limit_nm && nm.second().abs() <= limit_nm;
        if fits(motion_nm + *pressing_nm) {
            return Self {
                motion_nm,
                pressing: 1.0,
                slows: false,
            };
        }
        let least_nm = *pressing_nm * least;
        let slows = !fits(motion_nm + least_nm);
        let (motion_nm, pressing) = if slows {
            // What holds the arm is left. At the speeds of a tip on the belt, its centripetal acceleration is small.
            let holding_nm = model.bias_nm.to_joints();
            let change_nm = motion_nm - holding_nm;
            let part = affordable(&(holding_nm + least_nm), &change_nm, limit_nm);
            (holding_nm + change_nm * part.at_least(0.0), least)
        } else {
            (motion_nm, affordable(&motion_nm, pressing_nm, limit_nm))
        };
        Self {
            motion_nm,
            pressing,
            slows,
        }
    }
}

/// Returns the largest part, up to 1, of these torques that keeps both joints within ±`limit_nm` together with those that
/// come `before`; it is negative if those alone are beyond.
fn affordable(before_nm: &JointTorque<f32>, torque_nm: &JointTorque<f32>, limit_nm: f32) -> f32 {
    // Not a number without a torque, of which any part fits.
    let of_joint = |before: f32, torque: f32| {
        let per_nm = 1.0 / torque;
        limit_nm * per_nm.abs() - before * per_nm
    };
    1.0_f32
        .at_most(of_joint(before_nm.first(), torque_nm.first()))
        .at_most(of_joint(before_nm.second(), torque_nm.second()))
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector2;
    use painleve_shared::{Arm, ArmParameters, GeneralisedTorque, LinkMotion, Posture};
    use proptest::prelude::*;

    use super::*;

    /// Returns the model of an arm at rest on the belt.
    fn at_rest() -> Model {
        let arm = Arm::<f32>::new(ArmParameters::default()).unwrap();
        let theta_rad = arm
            .link_angles_on_belt_rad(0.1, Posture::ElbowDown)
            .unwrap();
        let rest = LinkMotion::zeros();
        Model::new(&arm, theta_rad, rest, &GeneralisedTorque::zeros())
    }

    /// Returns the torques of an acceleration along the belt, m/s².
    fn motion_nm(model: &Model, acceleration_m_s2: f32) -> JointTorque<f32> {
        let along = model.link_acceleration_rad_s2(&Vector2::new(acceleration_m_s2, 0.0));
        model.inverse_dynamics_in_air_nm(&along)
    }

    #[test]
    fn pressing_gets_the_torque_that_the_motion_leaves() {
        let model = at_rest();
        let pressing_nm = JointTorque::new(1.0, -1.0);
        for (motion_nm, part) in [(1.0, 1.0), (1.9, 0.1), (1.95, 0.05)] {
            let motion_nm = JointTorque::new(motion_nm, 0.0);
            let found = Allocation::new(&model, motion_nm, &pressing_nm, 2.0, 0.0);
            assert!((found.pressing - part).abs() < 1e-6, "{found:?} {part}");
            assert!(found.motion_nm == motion_nm && !found.slows);
        }
        let motion_nm = JointTorque::new(3.0, 0.0);
        for least in [0.0, 1.0] {
            let found = Allocation::new(&model, motion_nm, &pressing_nm, 2.0, least);
            assert!(found.pressing == least && found.slows, "{found:?}");
        }
    }

    proptest! {
        /// What is left of a motion too fast keeps its direction, and the least force.
        #[test]
        fn a_motion_too_fast_is_slowed_along_the_belt(
            acceleration_m_s2 in -300.0_f32..300.0, force_n in 0.0_f32..20.0, limit_nm in 1.0_f32..3.0,
        ) {
            let model = at_rest();
            let pressing_nm = model.torque_against_nm(&Vector2::new(-0.4 * force_n, force_n));
            let (least, wanted_nm) = (0.1, motion_nm(&model, acceleration_m_s2));
            let found = Allocation::new(&model, wanted_nm, &pressing_nm, limit_nm, least);
            let total_nm = found.motion_nm + pressing_nm * found.pressing;
            prop_assert!(total_nm.amax() <= limit_nm * 1.0001, "{found:?}");
            let free = model.free_acceleration_rad_s2(&found.motion_nm);
            let given = model.jacobian * free.vector();
            prop_assert!(given.y.abs() < 0.02 * (1.0 + acceleration_m_s2.abs()), "{given}");
            prop_assert!(found.pressing >= least && (found.pressing == least || !found.slows));
            prop_assert!((given.x - acceleration_m_s2).abs() < 0.1 || found.slows);
            prop_assert!(given.x * acceleration_m_s2 >= -0.1 && given.x.abs() <= acceleration_m_s2.abs() + 0.1);
        }
    }
}

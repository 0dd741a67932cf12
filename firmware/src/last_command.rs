//! The last commanded torques: the only value that flows from one tick's output to the next tick.

use core::sync::atomic::{Ordering, compiler_fence};

use nalgebra::Vector2;
use painleve_shared::counts::TorqueCounts;
use painleve_shared::{JointMotion, JointTorque};

/// The last commanded torques and their expected effect: the only state the controller keeps of its
/// output. The default is no torque.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LastCommand {
    /// Counts for the torque stages.
    pub counts: [TorqueCounts; 2],
    /// Joint torques that these counts represent, N·m.
    pub torque_nm: JointTorque<f32>,
    /// Whether a torque was limited: integrators then have to stop.
    pub saturated: bool,
    /// Contact force (f_t, f_n) that they are meant to cause, N.
    pub contact_force_n: Vector2<f32>,
    /// Expected acceleration of the joints until the next tick, rad/s².
    pub expected_acceleration_rad_s2: JointMotion<f32>,
    /// Part of that acceleration due to the contact force, rad/s².
    pub contact_acceleration_rad_s2: JointMotion<f32>,
    /// Velocity of the reference that the command follows, m/s.
    pub reference_velocity_m_s: f32,
    /// Torque withheld by rounding to counts, to be added at the next tick, N·m.
    pub(crate) rounding_nm: JointTorque<f32>,
}

impl LastCommand {
    /// Takes the torque off: the same as assigning the default.
    #[inline]
    pub fn clear(&mut self) {
        let Self {
            counts,
            torque_nm,
            saturated,
            contact_force_n,
            expected_acceleration_rad_s2,
            contact_acceleration_rad_s2,
            reference_velocity_m_s,
            rounding_nm,
        } = self;
        *counts = [TorqueCounts(0); 2];
        *torque_nm = JointTorque::zeros();
        *saturated = false;
        // Stored in line in two parts; as one, the compiler calls a loop that takes six times as long.
        compiler_fence(Ordering::SeqCst);
        *contact_force_n = Vector2::zeros();
        *expected_acceleration_rad_s2 = JointMotion::zeros();
        *contact_acceleration_rad_s2 = JointMotion::zeros();
        *reference_velocity_m_s = 0.0;
        *rounding_nm = JointTorque::zeros();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clearing_assigns_the_default() {
        let ones = JointTorque::new(1.0, 1.0);
        let mut command = LastCommand {
            counts: [TorqueCounts(1); 2],
            torque_nm: ones,
            saturated: true,
            contact_force_n: Vector2::new(1.0, 1.0),
            expected_acceleration_rad_s2: JointMotion::new(1.0, 1.0),
            contact_acceleration_rad_s2: JointMotion::new(1.0, 1.0),
            reference_velocity_m_s: 1.0,
            rounding_nm: ones,
        };
        command.clear();
        assert_eq!(command, LastCommand::default());
    }
}

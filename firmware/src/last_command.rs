//! The last command: what flows from one tick's output to the next tick.

use nalgebra::Vector2;
use painleve_shared::counts::TorqueCounts;
use painleve_shared::{JointMotion, JointTorque};

/// The last commanded torques and their expected effect. The default is no torque.
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

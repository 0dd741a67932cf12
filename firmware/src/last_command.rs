//! The last commanded torques: the only value that flows from one tick's output to the next tick.

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
    /// Whether a torque was limited.
    pub saturated: bool,
    /// Whether the contact guard changed the torques.
    pub guarded: bool,
    /// Expected acceleration of the joints until the next tick, rad/s².
    pub expected_acceleration_rad_s2: JointMotion<f32>,
    /// Part of that acceleration due to the contact force, rad/s².
    pub contact_acceleration_rad_s2: JointMotion<f32>,
    /// Torque withheld by rounding to counts, to be added at the next tick, N·m.
    pub(crate) rounding_nm: JointTorque<f32>,
}

impl LastCommand {
    /// Whether the torques differ from those requested: integrators then have to stop.
    pub fn is_constrained(&self) -> bool {
        self.saturated || self.guarded
    }
}

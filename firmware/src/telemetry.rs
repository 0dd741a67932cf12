//! What went on inside the controller at its last tick, in SI units.

use painleve_shared::Slip;
use painleve_shared::status::{Fault, SupervisorState};

/// A snapshot for logs and displays; nothing is controlled by it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Telemetry {
    /// Tick of the last sensor frame.
    pub tick: u32,
    /// Supervisor state.
    pub state: SupervisorState,
    /// Latched fault.
    pub fault: Option<Fault>,
    /// Estimated joint angles θ1, θ2, rad.
    pub theta_rad: [f32; 2],
    /// Estimated joint rates, rad/s.
    pub theta_dot_rad_s: [f32; 2],
    /// Estimated tip position z_t, m.
    pub tip_t_m: f32,
    /// Reference z_t*, m.
    pub reference_m: f32,
    /// Measured normal force, N.
    pub normal_force_n: f32,
    /// Measured tangential force, N.
    pub tangential_force_n: f32,
    /// Joint torques u1, u2 as given, rounded to counts, N·m.
    pub torque_nm: [f32; 2],
    /// Whether the tip is taken to touch.
    pub contact: bool,
    /// How sure that is, 0 … 1.
    pub contact_confidence: f32,
    /// Estimated friction coefficient.
    pub friction: f32,
    /// Its standard deviation.
    pub friction_deviation: f32,
    /// Direction of slip.
    pub slip: Slip,
    /// Whether the tip seems to move with the belt.
    pub sticks: bool,
    /// Edges of the admissible stretch of the belt, m.
    pub edges_m: [f32; 2],
    /// Whether an edge holds the reference back.
    pub at_edge: bool,
    /// Whether the tip is being brought back onto the belt.
    pub recovering: bool,
    /// Whether the contact guard changed the torque.
    pub guarded: bool,
    /// Whether the torque was limited.
    pub saturated: bool,
    /// Ticks on which the contact guard acted since the start.
    pub guarded_ticks: u32,
    /// Ticks with limited torque since the start.
    pub saturated_ticks: u32,
}

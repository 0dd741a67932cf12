//! What went on inside the controller at its last tick, in SI units.

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
    /// Commanded joint torques u1, u2, N·m.
    pub torque_nm: [f32; 2],
    /// Whether the tip is taken to touch.
    pub contact: bool,
    /// Whether the torque was limited.
    pub saturated: bool,
    /// Ticks with limited torque since the start.
    pub saturated_ticks: u32,
}

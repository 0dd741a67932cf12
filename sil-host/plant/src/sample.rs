//! One control tick for records: a [`Sample`].

use painleve_shared::{ActuatorFrame, SensorFrame};

use crate::mechanics::motion::ContactMode;

/// Both frames of a control tick and the truth behind them.
///
/// Plant values are those at the instant the sensors are read, before the answer acts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// Simulated time, s.
    pub time_s: f64,
    /// What the controller was told.
    pub sensor: SensorFrame,
    /// What it answered.
    pub actuator: ActuatorFrame,
    /// Angles θ1, θ2 from the downward vertical, rad.
    pub theta_rad: [f64; 2],
    /// Their rates, rad/s.
    pub theta_dot_rad_s: [f64; 2],
    /// Position of the tip along the belt z_t, m.
    pub tip_t_m: f64,
    /// Height of the tip over the belt, m.
    pub gap_m: f64,
    /// Velocity of the tip relative to the belt ż_r, m/s.
    pub slip_velocity_m_s: f64,
    /// Velocity of the belt v_belt, m/s.
    pub belt_speed_m_s: f64,
    /// Normal force f_n, N.
    pub normal_force_n: f64,
    /// Tangential force f_t, N.
    pub tangential_force_n: f64,
    /// Free normal acceleration b, m/s².
    pub b_m_s2: f64,
    /// p for the present direction of slip, 1/kg.
    pub p_per_kg: f64,
    /// Torques u1, u2 that act on the joints, N·m.
    pub torque_nm: [f64; 2],
    /// Reference z_t*, m; NaN while the controller follows none.
    pub reference_tip_t_m: f64,
    /// What holds the tip.
    pub mode: ContactMode,
}

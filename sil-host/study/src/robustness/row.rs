//! One run of the campaign and what it came to.

use painleve_shared::Posture;
use serde::Serialize;

/// What a run came to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ending {
    /// At the reference.
    Reached,
    /// At the governed edge, the reference being beyond it.
    AtEdge,
    /// At the governed edge, but that is more than 10 mm before the true one, and p not small.
    StoppedEarly,
    /// Elsewhere.
    NotReached,
    /// The tip left the belt after its capture.
    LiftOff,
    /// The tip was not captured in time.
    NotCaptured,
    /// The controller gave up.
    Fault,
    /// The plant could not be solved.
    Unsolved,
}

impl Ending {
    /// Whether the run succeeded.
    pub fn is_success(self) -> bool {
        matches!(self, Self::Reached | Self::AtEdge)
    }
}

/// One run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Its number: with the seed of the campaign it defines the run.
    pub index: usize,
    /// What it came to.
    pub ending: Ending,
    /// Number of the fault that the controller has latched.
    pub fault: Option<u8>,
    /// Start of the capture after enabling, s.
    pub capture_s: Option<f64>,
    /// Lift-offs after the capture.
    pub lift_offs: u64,
    /// When the first of them was, s.
    pub first_lift_off_s: Option<f64>,
    /// Largest distance from target or governed edge at the end, m.
    pub error_m: f64,
    /// What is tolerated of it, m.
    pub tolerance_m: f64,
    /// Distance of the tip from the edge p = 0 or the usable reach ahead, m.
    pub to_edge_m: f64,
    /// p at the tip as a part of Q22.
    pub p_ratio: f64,
    /// Times that contact was taken for flight while the tip slid.
    pub false_alarms: u32,
    /// Time after capture, s.
    pub slid_s: f64,
    /// Where the tip ended, m.
    pub tip_t_m: f64,
    /// Target of the reference, m.
    pub target_m: f64,
    /// Posture of the start.
    pub posture: Posture,
    /// Friction coefficient μ.
    pub mu: f64,
    /// Belt speed, m/s.
    pub v_belt_m_s: f64,
    /// Control rate, Hz.
    pub tick_hz: u32,
    /// Bits of the encoders.
    pub encoder_bits: u8,
    /// Bits of the torque stages.
    pub torque_bits: u8,
    /// Lag of the torque stages, s.
    pub torque_lag_s: f64,
    /// Delay from sample to torque, ticks.
    pub delay_ticks: f64,
    /// Standard deviation of the force cell's noise, N.
    pub force_noise_n: f64,
    /// Probability that a frame is lost.
    pub frame_loss: f64,
    /// Length of link 1, m.
    pub link_length_m: f64,
    /// Length of link 2, m.
    pub link_2_length_m: f64,
    /// Mass of link 1, kg.
    pub link_mass_kg: f64,
    /// Mass of link 2, kg.
    pub link_2_mass_kg: f64,
    /// Stiffness of the spring between the links, N·m/rad.
    pub stiffness_nm_rad: f64,
    /// Height of the first joint above the belt, m.
    pub height_m: f64,
    /// Tilt of the belt, rad.
    pub belt_tilt_rad: f64,
}

//! One run of the campaign and its ending.

use clap::ValueEnum;
use painleve_shared::Posture;
use serde::Serialize;

/// When a run counts as a success.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Criterion {
    /// The tip was captured and kept on the belt, without a fault.
    #[default]
    Kept,
    /// It also ends within 1 mm of target or governed edge, and that edge is near the true one.
    InPlace,
}

impl Criterion {
    /// Whether a run with this ending is a success.
    pub fn holds(self, ending: Ending) -> bool {
        match self {
            Self::Kept => ending.is_kept(),
            Self::InPlace => matches!(ending, Ending::Reached | Ending::AtEdge),
        }
    }

    /// Returns the name in tables and figures.
    pub(crate) fn words(self) -> &'static str {
        match self {
            Self::Kept => "kept",
            Self::InPlace => "in place",
        }
    }
}

/// Ending of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ending {
    /// At the reference.
    Reached,
    /// At the governed edge, because the reference is beyond it.
    AtEdge,
    /// At the governed edge, but more than 10 mm before the true edge, with a p that is not small.
    StoppedEarly,
    /// Elsewhere.
    NotReached,
    /// The tip left the belt after its capture, or is in the air at the end.
    LiftOff,
    /// The tip was not captured in time.
    NotCaptured,
    /// The controller latched a fault.
    Fault,
    /// The plant could not be solved.
    Unsolved,
}

impl Ending {
    /// Whether the tip was captured and kept on the belt, without a fault.
    pub fn is_kept(self) -> bool {
        matches!(
            self,
            Self::Reached | Self::AtEdge | Self::StoppedEarly | Self::NotReached
        )
    }
}

/// One run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Number of the run; together with the seed of the campaign it defines the run.
    pub index: usize,
    /// Ending of the run.
    pub ending: Ending,
    /// Number of the latched fault.
    pub fault: Option<u8>,
    /// Time from enabling to the start of the capture, s.
    pub capture_s: Option<f64>,
    /// Number of lift-offs after the capture.
    pub lift_offs: u64,
    /// Time of the first lift-off after the capture, s.
    pub first_lift_off_s: Option<f64>,
    /// Largest final distance from the governed reference, m.
    pub error_m: f64,
    /// Final distance of the tip from a reference that stands, on average over the time, m; absent where the governor
    /// moves it.
    pub resting_error_m: Option<f64>,
    /// Tolerance of the final distance, m.
    pub tolerance_m: f64,
    /// How far the tip is before the edge p = 0 towards the target, m; negative beyond it, null unless such an edge, and
    /// not the end of the reach or another limit of the governor, holds the reference back.
    pub to_edge_m: Option<f64>,
    /// p in the arm's final posture as a fraction of Q22.
    pub p_ratio: f64,
    /// Number of times that contact was mistaken for flight while the tip slid.
    pub false_alarms: u32,
    /// Simulated time after the capture, s.
    pub slid_s: f64,
    /// Change of torque from tick to tick while the tip moves, N·m: root mean square over ticks and joints.
    pub torque_change_moving_nm: Option<f64>,
    /// The same while it stands.
    pub torque_change_holding_nm: Option<f64>,
    /// Part of these changes, standing, that reverse the one before, 0 to 1.
    pub torque_reversals: Option<f64>,
    /// Standard deviation of the normal force while it stands, N.
    pub force_ripple_n: Option<f64>,
    /// Final tip position, m.
    pub tip_t_m: f64,
    /// Target of the reference, m; null without one.
    pub target_m: Option<f64>,
    /// Initial posture.
    pub posture: Posture,
    /// Friction coefficient μ.
    pub mu: f64,
    /// Belt speed, m/s.
    pub v_belt_m_s: f64,
    /// Control rate, Hz.
    pub tick_hz: u32,
    /// Resolution of the encoders, bits.
    pub encoder_bits: u8,
    /// Resolution of the torque stages, bits.
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

//! The control laws' common ground: what they are given and what they answer.

use nalgebra::Vector2;
use painleve_shared::range::OutOfRange;
use painleve_shared::{Arm, Pose, Posture};
use serde::{Deserialize, Serialize};

use crate::hybrid::{Hybrid, HybridSettings};
use crate::pid::{Pid, PidSettings};
use crate::reference::TipReference;

/// What a law knows at one tick.
#[derive(Clone, Copy, Debug)]
pub struct LawInput<'a> {
    /// The arm's model.
    pub arm: &'a Arm<f32>,
    /// Estimated joint angles θ, rad.
    pub theta_rad: Vector2<f32>,
    /// Estimated joint rates θ̇, rad/s.
    pub theta_dot_rad_s: Vector2<f32>,
    /// Sines and cosines of θ.
    pub pose: Pose<f32>,
    /// Posture in which the drive was armed.
    pub posture: Posture,
    /// Measured contact force (f_t, f_n), N.
    pub force_n: Vector2<f32>,
    /// Whether the tip touches the belt.
    pub contact: bool,
    /// Whether the torque of the tick before was limited.
    pub saturated: bool,
    /// Where the tip shall be.
    pub reference: TipReference,
    /// Time between two ticks, s.
    pub tick_s: f32,
}

/// A law's answer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LawOutput {
    /// Wanted joint torques (u1, u2), N·m, before limits.
    pub torque_nm: Vector2<f32>,
    /// Joint acceleration θ̈ that the law expects of them, rad/s².
    pub acceleration_rad_s2: Vector2<f32>,
}

/// Choice and settings of the control law.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LawSettings {
    /// No law: the drive never arms, torque is zero.
    #[default]
    Off,
    /// The paper's PID on the joints (section III-A).
    Pid(PidSettings),
    /// The paper's hybrid force/motion law (section III-B).
    Hybrid(HybridSettings),
}

impl LawSettings {
    /// The law's name.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::Pid(_) => "pid",
            Self::Hybrid(_) => "hybrid",
        }
    }

    /// Checks the settings of the chosen law.
    ///
    /// # Errors
    /// [`OutOfRange`] naming the first key that is out of range.
    pub fn validate(&self) -> Result<(), OutOfRange> {
        match self {
            Self::Off => Ok(()),
            Self::Pid(settings) => settings.validate(),
            Self::Hybrid(settings) => settings.validate(),
        }
    }
}

/// A law with its state.
#[derive(Clone, Copy, Debug)]
pub enum Law {
    /// See [`LawSettings::Off`].
    Off,
    /// See [`LawSettings::Pid`].
    Pid(Pid),
    /// See [`LawSettings::Hybrid`].
    Hybrid(Hybrid),
}

impl Law {
    /// The chosen law in its initial state.
    pub fn new(settings: &LawSettings) -> Self {
        match *settings {
            LawSettings::Off => Self::Off,
            LawSettings::Pid(settings) => Self::Pid(Pid::new(settings)),
            LawSettings::Hybrid(settings) => Self::Hybrid(Hybrid::new(settings)),
        }
    }

    /// Whether there is a law at all.
    pub fn is_on(&self) -> bool {
        !matches!(self, Self::Off)
    }

    /// Forgets everything; called when the drive is armed.
    pub fn reset(&mut self, input: &LawInput<'_>) {
        match self {
            Self::Off => {}
            Self::Pid(law) => law.reset(),
            Self::Hybrid(law) => law.reset(input),
        }
    }

    /// Torques for one tick.
    pub fn tick(&mut self, input: &LawInput<'_>) -> LawOutput {
        match self {
            Self::Off => LawOutput {
                torque_nm: Vector2::zeros(),
                acceleration_rad_s2: Vector2::zeros(),
            },
            Self::Pid(law) => law.tick(input),
            Self::Hybrid(law) => law.tick(input),
        }
    }
}

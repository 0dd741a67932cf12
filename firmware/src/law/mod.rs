//! The control laws, and the choice between them.
//!
//! - [`signals`]: what a law is given and what it answers
//! - [`pid`]: the paper's PID on the joints
//! - [`hybrid`]: the paper's hybrid force/motion law

pub mod hybrid;
pub mod pid;
pub mod signals;

use nalgebra::Vector2;
use painleve_shared::settings;

use hybrid::{Hybrid, HybridSettings};
use pid::{Pid, PidSettings};
use signals::{LawInput, LawOutput};

settings! {
    /// Choice and settings of the control law.
    #[derive(Copy)]
    pub enum LawSettings = Off {
        /// No law: the drive never arms, torque is zero.
        "off" => Off,
        /// The paper's PID on the joints (section III-A).
        "pid" => Pid(PidSettings),
        /// The paper's hybrid force/motion law (section III-B).
        "hybrid" => Hybrid(HybridSettings),
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
                contact_force_n: Vector2::zeros(),
            },
            Self::Pid(law) => law.tick(input),
            Self::Hybrid(law) => law.tick(input),
        }
    }
}

//! The parts of the controller that can be switched off, each by its configuration keys.

use serde::Serialize;

/// A part of the controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Part {
    /// The torque is kept on the side on which the tip stays pressed.
    Guard,
    /// The reference is kept off the paradox.
    Governor,
    /// A tip that left the belt is brought back; without it the law goes on.
    Recovery,
    /// The length of the links is calibrated.
    Calibration,
    /// Friction is estimated; without it the first guess is taken for certain.
    FrictionEstimate,
    /// Friction is fed forward from the estimate; without it from the last reading, as in the paper.
    FrictionObserver,
    /// Integral of the position's error.
    PositionIntegral,
    /// Integral of the force's error.
    ForceIntegral,
    /// The tip is pressed less where torque is short.
    PressesLess,
    /// The normal force is approached slowly after landing.
    ForceRamp,
    /// Unknown torques are estimated.
    Disturbance,
}

impl Part {
    /// All of them.
    pub const ALL: [Self; 11] = [
        Self::Guard,
        Self::Governor,
        Self::Recovery,
        Self::Calibration,
        Self::FrictionEstimate,
        Self::FrictionObserver,
        Self::PositionIntegral,
        Self::ForceIntegral,
        Self::PressesLess,
        Self::ForceRamp,
        Self::Disturbance,
    ];

    /// The overrides that switch it off.
    pub fn without(self) -> &'static [&'static str] {
        match self {
            Self::Guard => &["controller.guard.enabled=false"],
            Self::Governor => &["controller.governor.enabled=false"],
            Self::Recovery => &["controller.supervisor.on_lift_off=continue"],
            Self::Calibration => &["controller.calibration.enabled=false"],
            Self::FrictionEstimate => &[
                "controller.friction.first_deviation=0.001",
                "controller.friction.drift_per_sqrt_s=0.0001",
            ],
            Self::FrictionObserver => &["controller.law.hybrid.friction=measured"],
            Self::PositionIntegral => &["controller.law.hybrid.position_integral_gain_per_s3=0"],
            Self::ForceIntegral => &["controller.law.hybrid.force_integral_gain_per_s=0"],
            Self::PressesLess => &["controller.law.hybrid.presses_less=false"],
            Self::ForceRamp => &["controller.law.hybrid.force_time_constant_s=0"],
            Self::Disturbance => &["controller.disturbance.enabled=false"],
        }
    }
}

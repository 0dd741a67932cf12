//! The parts of the controller that can be switched off, with their configuration keys.

use serde::Serialize;

/// A part of the controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Part {
    /// Guard: limits the torque to the side on which the tip stays pressed.
    Guard,
    /// Governor: keeps the reference away from the paradox.
    Governor,
    /// Recovery: brings a tip that left the belt back; without it the law continues.
    Recovery,
    /// Calibration of the link lengths.
    Calibration,
    /// Friction estimate; without it the initial friction is taken as certain.
    FrictionEstimate,
    /// Feedforward of the estimated friction; without it the last reading is used, as in the paper.
    FrictionFeedForward,
    /// Integral of the position error.
    PositionIntegral,
    /// Integral of the force error.
    ForceIntegral,
    /// Reduction of the normal force where the torque is limited.
    ReduceForceWhenTorqueLimited,
    /// Gradual increase of the normal force after landing.
    ForceRamp,
    /// Estimate of unknown torques.
    Disturbance,
}

impl Part {
    /// All parts.
    pub const ALL: [Self; 11] = [
        Self::Guard,
        Self::Governor,
        Self::Recovery,
        Self::Calibration,
        Self::FrictionEstimate,
        Self::FrictionFeedForward,
        Self::PositionIntegral,
        Self::ForceIntegral,
        Self::ReduceForceWhenTorqueLimited,
        Self::ForceRamp,
        Self::Disturbance,
    ];

    /// Returns the overrides that switch the part off.
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
            Self::FrictionFeedForward => &["controller.law.hybrid.friction=measured"],
            Self::PositionIntegral => &["controller.law.hybrid.position_integral_gain_per_s3=0"],
            Self::ForceIntegral => &["controller.law.hybrid.force_integral_gain_per_s=0"],
            Self::ReduceForceWhenTorqueLimited => {
                &["controller.law.hybrid.reduce_force_when_torque_limited=false"]
            }
            Self::ForceRamp => &["controller.law.hybrid.force_time_constant_s=0"],
            Self::Disturbance => &["controller.disturbance.enabled=false"],
        }
    }
}

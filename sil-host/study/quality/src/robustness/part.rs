//! The parts of the controller that can be switched off, with their configuration keys.

use serde::Serialize;

/// A part of the controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Part {
    /// Governor: keeps the reference away from the paradox.
    Governor,
    /// Recovery: brings a tip that left the belt back; without it the law continues.
    Recovery,
    /// Calibration of the link lengths.
    Calibration,
    /// Friction estimate; without it the first guess is taken as exact.
    FrictionEstimate,
    /// Feedforward of the estimated friction; without it the last reading is used, as in the paper.
    FrictionFeedForward,
    /// Integral of the position error.
    PositionIntegral,
    /// Less normal force, then a slower motion, where the torque is limited.
    ForceReduction,
    /// Gradual rise of the normal force: after landing, and where the torque was limited.
    ForceRamp,
    /// Estimate of unknown torques.
    Disturbance,
    /// Estimate of how compliant the contact is; without it the contact is taken to be rigid.
    Response,
    /// Probe: small changes of the desired force that show how compliant the contact is.
    Probe,
    /// Cancelling of the acceleration by contact forces that were not fed forward.
    ForceDrift,
    /// Damping of a compliant contact.
    ContactDamping,
}

impl Part {
    /// Returns the overrides that switch the part off.
    pub fn without(self) -> &'static [&'static str] {
        match self {
            Self::Governor => &["controller.governor.enabled=false"],
            Self::Recovery => &["controller.supervisor.on_lift_off=continue"],
            Self::Calibration => &["controller.calibration.tolerance=0"],
            Self::FrictionEstimate => &["controller.friction.first_deviation=0"],
            Self::FrictionFeedForward => &["controller.law.hybrid.friction=measured"],
            Self::PositionIntegral => &["controller.law.hybrid.position_integral_gain_per_s3=0"],
            Self::ForceReduction => &["controller.law.hybrid.least_pressing=1"],
            Self::ForceRamp => &["controller.law.hybrid.pressing_rate_per_s=1e6"],
            Self::Disturbance => &["controller.disturbance.bandwidth_rad_s=0"],
            Self::Response => &["controller.response.enabled=false"],
            Self::Probe => &["controller.response.probe_n=0"],
            Self::ForceDrift => &["controller.law.hybrid.force_drift_rad_s=0"],
            Self::ContactDamping => &["controller.law.hybrid.contact_damping=0"],
        }
    }
}

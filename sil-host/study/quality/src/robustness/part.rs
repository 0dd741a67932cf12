//! The parts of the controller that can be switched off, with their configuration keys.

use serde::Serialize;

/// A part of the controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Part {
    /// Governor: keeps the reference away from the paradox (`governor.enabled=false`).
    Governor,
    /// Recovery: brings a tip that left the belt back; without it the law continues (`supervisor.on_lift_off=continue`).
    Recovery,
    /// Calibration of the link lengths (`calibration.tolerance=0`).
    Calibration,
    /// Friction estimate; without it the first guess is taken as exact (`friction.first_deviation=0`).
    FrictionEstimate,
    /// Feedforward of the estimated friction; without it the last reading is used, as in the paper (`law.hybrid.friction=measured`).
    FrictionFeedForward,
    /// Integral of the position error (`law.hybrid.position_integral_gain_per_s3=0`).
    PositionIntegral,
    /// Less normal force, then a slower motion, where the torque is limited (`law.hybrid.least_pressing=1`).
    ForceReduction,
    /// Gradual rise of the normal force: after landing, and where the torque was limited (`law.hybrid.pressing_rate_per_s=1e6`).
    ForceRamp,
    /// Estimate of unknown torques (`disturbance.bandwidth_rad_s=0`).
    Disturbance,
    /// Estimate of how compliant the contact is; without it the contact is taken to be rigid (`response.enabled=false`).
    Response,
    /// Probe: small changes of the desired force that show how compliant the contact is (`response.probe_n=0`).
    Probe,
    /// Cancelling of the acceleration by contact forces that were not fed forward (`law.hybrid.force_drift_rad_s=0`).
    ForceDrift,
    /// Damping of a compliant contact (`law.hybrid.contact_damping=0`).
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

#[cfg(test)]
mod tests {
    use clap::ValueEnum;

    use super::*;

    #[test]
    fn the_help_names_the_keys_that_switch_a_part_off() {
        for part in Part::value_variants() {
            let value = part.to_possible_value().unwrap();
            let help = value.get_help().unwrap().to_string();
            for key in part.without() {
                let key = key.trim_start_matches("controller.");
                assert!(help.contains(key), "{key} is not in '{help}'");
            }
        }
    }
}

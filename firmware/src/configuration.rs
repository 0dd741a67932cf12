//! Everything that can be set about the controller, checked before it runs.
//!
//! Kept apart from state: a configuration is a value that can be stored, sent
//! over a link (serde) and compared; the controller is made from it.

use painleve_shared::counts::{EncoderScale, LinearScale};
use painleve_shared::range::{self, OutOfRange};
use painleve_shared::settings::{SettingValue, Settings};
use painleve_shared::{Arm, ArmParameters, Real, check_setting};
use serde::{Deserialize, Serialize};

use crate::estimate::belt::BeltSettings;
use crate::estimate::calibration::CalibrationSettings;
use crate::estimate::contact::ContactSettings;
use crate::estimate::disturbance::DisturbanceSettings;
use crate::estimate::friction::FrictionSettings;
use crate::estimate::joints::EstimatorSettings;
use crate::guard::GuardSettings;
use crate::law::LawSettings;
use crate::recover::RecoverySettings;
use crate::refer::governor::GovernorSettings;
use crate::refer::reference::Program;
use crate::supervise::deadline_monitor::DeadlineLimits;
use crate::supervise::supervisor::SupervisorSettings;

/// The converters' scalings as the controller knows them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Converters {
    /// Encoders of θ1 and of θ2 − θ1.
    pub encoders: [EncoderScale; 2],
    /// Force cell, N.
    pub force: LinearScale<f32>,
    /// Torque stages, N·m.
    pub torque: LinearScale<f32>,
}

impl Converters {
    /// Checks resolutions and ranges.
    ///
    /// # Errors
    /// [`OutOfRange`] with a key relative to the converters.
    pub fn validate(&self) -> Result<(), OutOfRange> {
        for (index, encoder) in self.encoders.iter().enumerate() {
            encoder
                .validate()
                .map_err(|error| error.at(index).inside("encoders"))?;
        }
        within("force", self.force.validate())?;
        within("torque", self.torque.validate())
    }
}

/// Configuration of the controller.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Configuration {
    /// Control rate, Hz.
    pub tick_hz: f32,
    /// The arm as the controller knows it.
    pub arm: ArmParameters<f32>,
    /// What a count is worth.
    pub converters: Converters,
    /// Largest torque on either joint, N·m.
    pub torque_limit_nm: f32,
    /// How rates are estimated from counts.
    pub estimator: EstimatorSettings,
    /// When the tip is taken to touch the belt.
    pub contact: ContactSettings,
    /// How friction is estimated.
    pub friction: FrictionSettings,
    /// What is known about the belt.
    pub belt: BeltSettings,
    /// How unknown torques are estimated.
    pub disturbance: DisturbanceSettings,
    /// How the links' length is calibrated.
    pub calibration: CalibrationSettings,
    /// When the drive is armed, and when it is shut down.
    pub supervisor: SupervisorSettings,
    /// How many lapses in a row are survived.
    pub deadlines: DeadlineLimits,
    /// The control law.
    pub law: LawSettings,
    /// How the tip is kept pressed on the belt.
    pub guard: GuardSettings,
    /// How the reference is kept off the paradox.
    pub governor: GovernorSettings,
    /// How a tip that left the belt is brought back.
    pub recovery: RecoverySettings,
    /// Where the tip shall go.
    pub reference: Program,
}

impl Configuration {
    /// Time between two ticks, s.
    pub fn tick_s(&self) -> f32 {
        1.0 / self.tick_hz
    }

    /// How far a count of the coarser encoder moves the tip along the belt, m.
    pub fn tip_count_m(&self) -> f32 {
        let [one, two] = self.converters.encoders;
        let count_rad = one.rad_per_count::<f32>().at_least(two.rad_per_count());
        self.arm.height_m * count_rad
    }

    /// Checks every number and makes the arm's model.
    ///
    /// # Errors
    /// [`OutOfRange`] for the first setting that is out of range, with its key relative to the
    /// configuration: `law.hybrid.normal_force_n`.
    pub fn validate(&self) -> Result<Arm<f32>, OutOfRange> {
        range::check("tick_hz", self.tick_hz, 10.0, 1e5)?;
        let arm = Arm::new(self.arm)?;
        self.converters
            .validate()
            .map_err(|error| error.inside("converters"))?;
        check_setting!(self.torque_limit_nm, 0.0, self.converters.torque.range)?;
        within("estimator", self.estimator.validate())?;
        check_setting!(self.estimator.bandwidth_rad_s, 1.0, 3.0 * self.tick_hz)?;
        within("contact", self.contact.validate())?;
        check_setting!(self.contact.contact_n, 1e-3, self.converters.force.range)?;
        check_setting!(
            self.contact.force_noise_n,
            1e-4,
            self.converters.force.range
        )?;
        within("supervisor", self.supervisor.validate())?;
        within("friction", self.friction.validate())?;
        within("belt", self.belt.validate())?;
        within("disturbance", self.disturbance.validate())?;
        within("calibration", self.calibration.validate())?;
        within("deadlines", self.deadlines.validate())?;
        within("law", self.law.check(None))?;
        within("guard", self.guard.validate())?;
        within("governor", self.governor.validate())?;
        within("recovery", self.recovery.validate())?;
        within("reference", self.reference.check(None))?;
        // A governed reference may be out of reach: it is held at the edge.
        let reach_m = if self.governor.enabled {
            2.0 * self.arm.link_length_m
        } else {
            arm.reach_on_belt_m()
        };
        within("reference", self.reference.check_reach(reach_m))?;
        Ok(arm)
    }
}

/// Adds the name of a group to the key of an error.
fn within(group: &'static str, result: Result<(), OutOfRange>) -> Result<(), OutOfRange> {
    result.map_err(|error| error.inside(group))
}

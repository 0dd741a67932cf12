//! The built-in plants as one type: the arm on a rigid or on a compliant contact.

use nalgebra::Vector2;
use painleve_shared::{JointTorque, LinkMotion};

use super::ArmOnBelt;
use super::belt::BeltSettings;
use super::compliant::CompliantArmOnBelt;
use crate::plant::{Plant, PlantError, Probe, Snapshot};

/// The plant of a scenario, selected by its `contact.kind`.
#[derive(Clone, Debug)]
pub enum BuiltInPlant {
    /// Rigid contact.
    Rigid(ArmOnBelt),
    /// Compliant contact.
    Compliant(CompliantArmOnBelt),
}

impl BuiltInPlant {
    /// Gives the belt this friction and speed from now on.
    pub fn set_belt(&mut self, belt: &BeltSettings) {
        match self {
            Self::Rigid(plant) => plant.set_belt(belt),
            Self::Compliant(plant) => plant.set_belt(belt),
        }
    }
}

impl Plant for BuiltInPlant {
    fn snapshot(&self) -> Snapshot {
        match self {
            Self::Rigid(plant) => plant.snapshot(),
            Self::Compliant(plant) => plant.snapshot(),
        }
    }

    #[inline]
    fn command_torque(&mut self, target_nm: JointTorque<f64>, lag_s: f64) {
        match self {
            Self::Rigid(plant) => plant.command_torque(target_nm, lag_s),
            Self::Compliant(plant) => plant.command_torque(target_nm, lag_s),
        }
    }

    fn advance(&mut self, until_s: f64, probe: &mut dyn Probe) -> Result<(), PlantError> {
        match self {
            Self::Rigid(plant) => Plant::advance(plant, until_s, probe),
            Self::Compliant(plant) => Plant::advance(plant, until_s, probe),
        }
    }

    #[inline]
    fn time_s(&self) -> f64 {
        match self {
            Self::Rigid(plant) => plant.time_s(),
            Self::Compliant(plant) => Plant::time_s(plant),
        }
    }

    #[inline]
    fn link_angles_rad(&self) -> LinkMotion<f64> {
        match self {
            Self::Rigid(plant) => plant.link_angles_rad(),
            Self::Compliant(plant) => plant.link_angles_rad(),
        }
    }

    #[inline]
    fn contact_force_n(&self) -> Vector2<f64> {
        match self {
            Self::Rigid(plant) => plant.contact_force_n(),
            Self::Compliant(plant) => plant.contact_force_n(),
        }
    }
}

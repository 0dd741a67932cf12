//! The built-in plants as one type: the arm on a rigid or on a compliant contact.

use nalgebra::Vector2;
use painleve_shared::{JointTorque, LinkMotion, OutOfRange};

use super::ArmOnBelt;
use super::belt::BeltSettings;
use super::compliant::{CompliantArmOnBelt, ContactKind};
use crate::plant::{Plant, PlantError, Probe, Snapshot};
use crate::scenario::Scenario;

/// The plant of a scenario, selected by its `contact.kind`.
#[derive(Clone, Debug)]
pub enum BuiltInPlant {
    /// Rigid contact.
    Rigid(ArmOnBelt),
    /// Compliant contact.
    Compliant(CompliantArmOnBelt),
}

impl BuiltInPlant {
    /// Creates the scenario's plant at its start.
    ///
    /// # Errors
    /// [`OutOfRange`] naming the first key that is out of range, or an effect that requires a
    /// compliant contact.
    pub fn new(scenario: &Scenario) -> Result<Self, OutOfRange> {
        let parameters = scenario.plant_parameters();
        let start = scenario.initial.state();
        let (contact, effects) = (&scenario.contact, &scenario.effects);
        Ok(match contact.kind {
            ContactKind::Rigid => {
                effects.none()?;
                Self::Rigid(ArmOnBelt::new(&parameters, start)?)
            }
            ContactKind::Compliant => Self::Compliant(CompliantArmOnBelt::new(
                &parameters,
                contact,
                effects,
                start,
            )?),
        })
    }
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

    fn command_torque(&mut self, target_nm: JointTorque<f64>, lag_s: f64) {
        match self {
            Self::Rigid(plant) => plant.command_torque(target_nm, lag_s),
            Self::Compliant(plant) => plant.command_torque(target_nm, lag_s),
        }
    }

    fn advance(&mut self, until_s: f64, probe: &mut impl Probe) -> Result<(), PlantError> {
        match self {
            Self::Rigid(plant) => Plant::advance(plant, until_s, probe),
            Self::Compliant(plant) => Plant::advance(plant, until_s, probe),
        }
    }

    fn time_s(&self) -> f64 {
        match self {
            Self::Rigid(plant) => plant.time_s(),
            Self::Compliant(plant) => Plant::time_s(plant),
        }
    }

    fn link_angles_rad(&self) -> LinkMotion<f64> {
        match self {
            Self::Rigid(plant) => plant.link_angles_rad(),
            Self::Compliant(plant) => plant.link_angles_rad(),
        }
    }

    fn contact_force_n(&self) -> Vector2<f64> {
        match self {
            Self::Rigid(plant) => plant.contact_force_n(),
            Self::Compliant(plant) => plant.contact_force_n(),
        }
    }
}

//! The plant that a scenario describes.

use painleve_shared::OutOfRange;

use super::Scenario;
use crate::mechanics::compliant::{CompliantArmOnBelt, ContactKind};
use crate::mechanics::{ArmOnBelt, BuiltInPlant};

impl BuiltInPlant {
    /// Creates the scenario's plant at its start.
    ///
    /// # Errors
    /// [`OutOfRange`] naming the first key that is out of range, or an effect that requires a
    /// compliant contact.
    pub fn new(scenario: &Scenario) -> Result<Self, OutOfRange> {
        let parameters = scenario.plant_parameters();
        let start = scenario.initial.state(&parameters.arm)?;
        let (contact, effects) = (&scenario.contact, &scenario.effects);
        Ok(match contact.kind {
            ContactKind::Rigid => {
                effects.none(&parameters.arm)?;
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

//! Effects of a real rig that the paper's arm lacks. Each is off by default, and they can be
//! combined.
//!
//! - [`friction`]: friction that changes along the belt and over time
//!   ([`friction_file`]: from a CSV file)
//! - [`surface`]: a belt that is uneven or vibrates
//! - [`hanging_belt`]: a belt that yields between its rollers
//! - [`joints`]: friction in the joints
//! - [`gear`]: elastic gears with backlash and separate rotors, encoders on either side
//! - [`push`]: external forces on the tip; [`payload`]: a mass that it picks up
//!
//! They require the arm on a compliant contact ([`compliant`](super::compliant)); the rigid plant
//! rejects them.

pub mod friction;
pub mod friction_file;
pub mod gear;
pub mod hanging_belt;
pub mod joints;
pub mod payload;
pub mod push;
pub mod surface;

use painleve_shared::{ArmParameters, OutOfRange, range, settings};

use friction::FrictionChange;
use gear::GearSettings;
use hanging_belt::HangingBelt;
use joints::JointFriction;
use payload::Payload;
use push::Push;
use surface::Surface;

settings! {
    /// Effects of the plant. They require a compliant contact.
    pub struct Effects {
        /// Changes of friction.
        friction: FrictionChange = FrictionChange::None;
        /// The belt's surface.
        surface: Surface = Surface::default();
        /// A belt that hangs between its rollers.
        hanging_belt: HangingBelt = HangingBelt::default();
        /// Friction in the joints.
        joints: JointFriction = JointFriction::default();
        /// Gears between motors and joints.
        gear: GearSettings = GearSettings::default();
        /// A push on the tip.
        push: Push = Push::default();
        /// A mass that the tip picks up.
        payload: Payload = Payload::default();
    }
}

impl Effects {
    /// Checks that all effects are off, and that the joints have no friction, for a plant that does
    /// not support them.
    ///
    /// # Errors
    /// [`OutOfRange`] naming the first effect that is on.
    pub fn none(&self, arm: &ArmParameters<f64>) -> Result<(), OutOfRange> {
        let off = |key, is_on: bool| range::check(key, f64::from(u8::from(is_on)), 0.0, 0.0);
        off(
            "arm.coulomb_friction_nm with contact.kind = rigid",
            arm.coulomb_friction_nm != [0.0; 2],
        )?;
        off(
            "effects.friction with contact.kind = rigid",
            self.friction != FrictionChange::None,
        )?;
        off(
            "effects.surface with contact.kind = rigid",
            !self.surface.is_flat(),
        )?;
        off(
            "effects.hanging_belt with contact.kind = rigid",
            self.hanging_belt.is_on(),
        )?;
        off(
            "effects.joints with contact.kind = rigid",
            self.joints.is_on(),
        )?;
        off("effects.gear with contact.kind = rigid", self.gear.elastic)?;
        off("effects.push with contact.kind = rigid", self.push.is_on())?;
        off(
            "effects.payload with contact.kind = rigid",
            self.payload.is_on(),
        )
    }
}

//! What a rig has and the paper's arm has not, each effect off by default, all of them combinable.
//!
//! - [`friction`]: friction that changes along the belt and over time
//! - [`surface`]: a belt that is not flat or does not keep still
//! - [`joints`]: friction in the joints
//! - [`gear`]: gears that give, with backlash, rotors of their own, encoders on either side
//! - [`push`]: forces on the tip from outside
//!
//! They belong to the arm on a belt that gives ([`compliant`](super::compliant)); the rigid plant refuses them.

pub mod friction;
pub mod gear;
pub mod joints;
pub mod push;
pub mod surface;

use painleve_shared::{OutOfRange, range, settings};

use friction::FrictionChange;
use gear::GearSettings;
use joints::JointFriction;
use push::Push;
use surface::Surface;

settings! {
    /// All effects of the plant. They ask for a contact that gives.
    #[derive(Copy)]
    pub struct Effects {
        /// How friction changes.
        friction: FrictionChange = FrictionChange::None;
        /// The belt's surface.
        surface: Surface = Surface::default();
        /// Friction in the joints.
        joints: JointFriction = JointFriction::default();
        /// Gears between motors and joints.
        gear: GearSettings = GearSettings::default();
        /// A push on the tip.
        push: Push = Push::default();
    }
}

impl Effects {
    /// Checks that nothing is on, for a plant that has none of them.
    ///
    /// # Errors
    /// [`OutOfRange`] naming the first effect that is on.
    pub fn none(&self) -> Result<(), OutOfRange> {
        let off = |key, is_on: bool| range::check(key, f64::from(u8::from(is_on)), 0.0, 0.0);
        off(
            "effects.friction with contact.kind = rigid",
            self.friction != FrictionChange::None,
        )?;
        off(
            "effects.surface with contact.kind = rigid",
            !self.surface.is_flat(),
        )?;
        off(
            "effects.joints with contact.kind = rigid",
            self.joints.is_on(),
        )?;
        off("effects.gear with contact.kind = rigid", self.gear.elastic)?;
        off("effects.push with contact.kind = rigid", self.push.is_on())
    }
}

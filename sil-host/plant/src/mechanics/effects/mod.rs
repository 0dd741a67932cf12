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
    /// Returns the key of the first effect that is on, or of the joints' friction: a plant with rigid contact does not
    /// support them.
    pub fn first_on(&self, arm: &ArmParameters<f64>) -> Option<&'static str> {
        let all = [
            (
                "arm.coulomb_friction_nm",
                arm.coulomb_friction_nm != [0.0; 2],
            ),
            ("effects.friction", self.friction != FrictionChange::None),
            ("effects.surface", !self.surface.is_flat()),
            ("effects.hanging_belt", self.hanging_belt.is_on()),
            ("effects.joints", self.joints.is_on()),
            ("effects.gear", self.gear.elastic),
            ("effects.push", self.push.is_on()),
            ("effects.payload", self.payload.is_on()),
        ];
        all.into_iter()
            .find_map(|(key, is_on)| is_on.then_some(key))
    }

    /// Checks that none is on.
    ///
    /// # Errors
    /// [`OutOfRange`] naming the [first one](Self::first_on) that is.
    pub fn none(&self, arm: &ArmParameters<f64>) -> Result<(), OutOfRange> {
        self.first_on(arm)
            .map_or(Ok(()), |key| range::check(key, 1.0, 0.0, 0.0))
    }
}

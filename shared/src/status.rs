//! The controller's status: supervisor states and faults.

use strum::{EnumMessage, FromRepr, IntoStaticStr, VariantArray};

/// State of the controller's supervisor. Its number crosses the link.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Hash, FromRepr, IntoStaticStr, VariantArray,
)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[strum(serialize_all = "kebab-case")]
#[repr(u8)]
pub enum SupervisorState {
    /// Not enabled; torque is zero.
    #[default]
    Idle = 0,
    /// Enabled; the arm holds its position, or returns a tip in the air to the belt, until contact is confirmed.
    Armed = 1,
    /// The arm follows the reference.
    Tracking = 2,
    /// Contact was lost while tracking.
    LiftOff = 3,
    /// A fault is latched; torque is zero until reset.
    Fault = 4,
}

impl SupervisorState {
    /// All states, ordered by number.
    pub const ALL: &[Self] = Self::VARIANTS;

    /// Returns the state with this number.
    pub fn from_code(code: u8) -> Option<Self> {
        Self::from_repr(code)
    }

    /// Returns the state's name.
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// Returns whether torque may be applied in this state.
    #[inline]
    pub fn drives(self) -> bool {
        matches!(self, Self::Armed | Self::Tracking | Self::LiftOff)
    }
}

/// Reason for a stop of the controller. Numbers are stable and never reused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, EnumMessage, FromRepr, VariantArray)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Fault {
    /// encoder reading out of range
    EncoderOutOfRange = 1,
    /// joint moved faster than it physically can
    EncoderJump = 2,
    /// force reading out of range
    ForceOutOfRange = 3,
    /// sensor frame repeated an old sequence number
    StaleFrame = 4,
    /// too many sensor frames lost
    LostFrames = 5,
    /// control law gave a number that is not finite
    NotFinite = 6,
    /// contact not confirmed in time after enabling
    ContactNotFound = 7,
    /// contact lost for longer than allowed
    LiftOffTooLong = 8,
    /// control ticks not done when the next was due
    Overrun = 9,
    /// too many ticks without a sensor frame
    MissingFrame = 10,
    /// too many broken messages
    CorruptMessages = 11,
    /// tip left the belt again and again
    RecoveryFailed = 12,
    /// arming refused: readings implausible or a torque stage not ready
    ArmingRefused = 13,
    /// torque stage not ready
    StageNotReady = 14,
    /// force cell contradicts the encoders or the torques
    GapAgainstForce = 15,
    /// joint moved too far while being commissioned
    MovedTooFar = 16,
    /// winding of a torque stage too hot
    WindingTooHot = 17,
}

impl Fault {
    /// All faults, ordered by number.
    pub const ALL: &[Self] = Self::VARIANTS;

    /// Returns the fault with this number; 0 means none.
    pub fn from_code(code: u8) -> Option<Self> {
        Self::from_repr(code)
    }

    /// Returns the description in the documentation of the variant.
    pub fn description(self) -> &'static str {
        self.get_documentation().unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_round_trip_and_zero_is_no_fault() {
        for state in SupervisorState::ALL {
            assert_eq!(SupervisorState::from_code(*state as u8), Some(*state));
        }
        for (index, fault) in Fault::ALL.iter().enumerate() {
            assert_eq!(*fault as usize, index + 1, "a number is missing");
            assert_eq!(Fault::from_code(*fault as u8), Some(*fault));
            assert!(!fault.description().is_empty(), "{fault:?}");
        }
        assert_eq!(SupervisorState::LiftOff.name(), "lift-off");
        assert_eq!(Fault::from_code(0), None);
        assert_eq!(SupervisorState::from_code(9), None);
    }
}

//! What the controller says about itself: supervisor state, faults, flags.

/// State of the controller's supervisor. The number is what crosses the link.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum SupervisorState {
    /// Not enabled; torque is zero.
    #[default]
    Idle = 0,
    /// Enabled; the arm is held where it is while contact is confirmed.
    Armed = 1,
    /// The reference is followed.
    Tracking = 2,
    /// Contact was lost while tracking.
    LiftOff = 3,
    /// A fault is latched; torque is zero until reset.
    Fault = 4,
}

impl SupervisorState {
    /// All states, by number.
    pub const ALL: [Self; 5] = [
        Self::Idle,
        Self::Armed,
        Self::Tracking,
        Self::LiftOff,
        Self::Fault,
    ];

    /// The state with this number.
    pub fn from_code(code: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|state| *state as u8 == code)
    }

    /// The state's name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Idle => "idle",
            Self::Armed => "armed",
            Self::Tracking => "tracking",
            Self::LiftOff => "lift-off",
            Self::Fault => "fault",
        }
    }
}

/// Why the controller stopped. Numbers are stable: never reuse one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Fault {
    /// An encoder reading its resolution does not allow.
    EncoderOutOfRange = 1,
    /// A joint moved faster between two frames than it physically can.
    EncoderJump = 2,
    /// A force reading its resolution does not allow.
    ForceOutOfRange = 3,
    /// A frame repeated an old sequence number.
    StaleFrame = 4,
    /// Too many frames were lost in a row.
    FramesLost = 5,
    /// The control law produced a number that is not finite.
    NotFinite = 6,
    /// Contact was not confirmed in time after enabling.
    ContactNotFound = 7,
    /// Contact was lost for longer than allowed.
    LiftOffTooLong = 8,
    /// Ticks were not done when the next one was due.
    Overrun = 9,
    /// Too many ticks in a row had no sensor frame.
    FrameMissing = 10,
    /// Too many messages in a row were broken.
    CorruptMessages = 11,
    /// The tip left the belt again and again.
    RecoveryFailed = 12,
}

impl Fault {
    /// All faults, by number.
    pub const ALL: [Self; 12] = [
        Self::EncoderOutOfRange,
        Self::EncoderJump,
        Self::ForceOutOfRange,
        Self::StaleFrame,
        Self::FramesLost,
        Self::NotFinite,
        Self::ContactNotFound,
        Self::LiftOffTooLong,
        Self::Overrun,
        Self::FrameMissing,
        Self::CorruptMessages,
        Self::RecoveryFailed,
    ];

    /// The fault with this number; 0 means none.
    pub fn from_code(code: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|fault| *fault as u8 == code)
    }

    /// One sentence about the fault.
    pub fn description(self) -> &'static str {
        match self {
            Self::EncoderOutOfRange => "encoder reading out of range",
            Self::EncoderJump => "joint moved faster than it physically can",
            Self::ForceOutOfRange => "force reading out of range",
            Self::StaleFrame => "sensor frame repeated an old sequence number",
            Self::FramesLost => "too many sensor frames lost in a row",
            Self::NotFinite => "control law gave a number that is not finite",
            Self::ContactNotFound => "contact not confirmed in time after enabling",
            Self::LiftOffTooLong => "contact lost for longer than allowed",
            Self::Overrun => "control ticks not done when the next was due",
            Self::FrameMissing => "too many ticks in a row without a sensor frame",
            Self::CorruptMessages => "too many broken messages in a row",
            Self::RecoveryFailed => "tip left the belt again and again",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_round_trip_and_zero_is_no_fault() {
        for state in SupervisorState::ALL {
            assert_eq!(SupervisorState::from_code(state as u8), Some(state));
        }
        for fault in Fault::ALL {
            assert_eq!(Fault::from_code(fault as u8), Some(fault));
        }
        assert_eq!(Fault::from_code(0), None);
        assert_eq!(SupervisorState::from_code(9), None);
    }
}

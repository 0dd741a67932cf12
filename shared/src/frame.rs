//! Frames that cross the link at every control tick, in raw counts.
//!
//! The plant publishes a [`SensorFrame`]; the controller answers with an [`ActuatorFrame`] that
//! echoes its tick. Both counters wrap; compare them only by their difference.

pub use ::bitflags;
use ::bitflags::bitflags;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::counts::{EncoderCounts, ForceCounts, Micrometres, TorqueCounts};
use crate::status::{Fault, SupervisorState};

#[cfg(feature = "zero-copy")]
use {
    iceoryx2_bb_derive_macros::ZeroCopySend,
    iceoryx2_bb_elementary_traits::zero_copy_send::ZeroCopySend,
};

/// Digital inputs of the controller, one bit each.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "zero-copy", derive(ZeroCopySend))]
#[cfg_attr(feature = "zero-copy", type_name("painleve::DigitalInputs"))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DigitalInputs(pub u32);

bitflags! {
    impl DigitalInputs: u32 {
        /// The drive is enabled while this is high; low means torque off.
        const ENABLE = 1;
        /// A rising edge clears a latched fault.
        const RESET = 1 << 1;
        /// The board refuses to arm: its switch is closed and arming permitted, but readings are implausible
        /// or a torque stage is not ready.
        const ARMING_REFUSED = 1 << 2;
        /// A torque stage is not ready while the drive is armed.
        const STAGE_NOT_READY = 1 << 3;
        /// Encoders and force cell contradict each other while the drive is armed.
        const GAP_AGAINST_FORCE = 1 << 4;
        /// A torque stage's winding is too hot while the drive is armed.
        const WINDING_HOT = 1 << 5;
        /// Prolongs the tick until the next one is due, to test the lapse monitor. Only a board with frames from the
        /// host, whose stages are off, and a real-time process have this input.
        const OVERLOAD = 1 << 31;
    }
}

/// Flags of the controller's state, one bit each.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "zero-copy", derive(ZeroCopySend))]
#[cfg_attr(feature = "zero-copy", type_name("painleve::StatusFlags"))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct StatusFlags(pub u16);

bitflags! {
    impl StatusFlags: u16 {
        /// The contact decision: the tip touches the belt.
        const CONTACT = 1;
        /// The law requested more torque than allowed.
        const SATURATED = 1 << 1;
        /// The last segment of the reference has ended.
        const REFERENCE_DONE = 1 << 2;
        /// The reference is beyond the edge of the admissible stretch and held at the edge.
        const AT_EDGE = 1 << 4;
        /// The tip is being returned to the belt.
        const RECOVERING = 1 << 5;
        /// In contact: estimated slip direction ż_r < 0 (clear: ż_r > 0).
        const SLIP_NEGATIVE = 1 << 6;
        /// In contact: the tip is estimated to stick to the belt.
        const STICKS = 1 << 7;
    }
}

/// One sample of all of the controller's inputs.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "zero-copy", derive(ZeroCopySend))]
#[cfg_attr(feature = "zero-copy", type_name("painleve::SensorFrame"))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SensorFrame {
    /// Control tick of the sample; wraps.
    pub tick: u32,
    /// Running number of frames sent; wraps.
    pub sequence: u32,
    /// Joint angles q' = (θ1, θ2 − θ1): the second encoder sits in the elbow.
    pub joints: [EncoderCounts; 2],
    /// Normal force f_n on the tip, positive away from the belt.
    pub normal_force: ForceCounts,
    /// Tangential force f_t on the tip, positive along +t.
    pub tangential_force: ForceCounts,
    /// Digital inputs.
    pub inputs: DigitalInputs,
}

/// The controller's answer to one sensor frame.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "zero-copy", derive(ZeroCopySend))]
#[cfg_attr(feature = "zero-copy", type_name("painleve::ActuatorFrame"))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ActuatorFrame {
    /// Tick of the sensor frame this answers.
    pub tick: u32,
    /// Running number of frames sent; wraps.
    pub sequence: u32,
    /// Joint torques u1, u2.
    pub torques: [TorqueCounts; 2],
    /// Reference z_t* of this tick.
    pub reference_tip: Micrometres,
    /// Estimated tip position z_t.
    pub estimated_tip: Micrometres,
    /// Number of the [`SupervisorState`].
    pub state: u8,
    /// Number of the latched [`Fault`], 0 for none.
    pub fault: u8,
    /// Flags.
    pub flags: StatusFlags,
}

impl ActuatorFrame {
    /// Returns the supervisor's state; `None` for a number unknown to this version.
    pub fn supervisor_state(&self) -> Option<SupervisorState> {
        SupervisorState::from_code(self.state)
    }

    /// Returns whether this version knows both the state and the fault.
    pub fn is_understood(&self) -> bool {
        self.supervisor_state().is_some() && (self.fault == 0 || self.latched_fault().is_some())
    }

    /// Returns the latched fault, if any.
    pub fn latched_fault(&self) -> Option<Fault> {
        Fault::from_code(self.fault)
    }
}

#[cfg(test)]
impl SensorFrame {
    /// Returns the frame with the longest encoding.
    pub(crate) const LONGEST: Self = Self {
        tick: u32::MAX,
        sequence: u32::MAX,
        joints: [EncoderCounts(u32::MAX); 2],
        normal_force: ForceCounts(i32::MIN),
        tangential_force: ForceCounts(i32::MIN),
        inputs: DigitalInputs(u32::MAX),
    };
}

//! What crosses the link at every control tick, in raw counts.
//!
//! The plant publishes a [`SensorFrame`]; the controller answers with an
//! [`ActuatorFrame`] that echoes its tick. Both counters wrap; compare them by
//! difference only.

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
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "zero-copy", derive(ZeroCopySend))]
#[cfg_attr(feature = "zero-copy", type_name("painleve::DigitalInputs"))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DigitalInputs(pub u32);

impl DigitalInputs {
    /// The drive is enabled while this is high; low means torque off.
    pub const ENABLE: Self = Self(1);
    /// A rising edge clears a latched fault.
    pub const RESET: Self = Self(1 << 1);
    /// Makes the tick last until the next one is due. Only the emulated board has this
    /// input, for tests of the deadline monitor.
    pub const OVERLOAD: Self = Self(1 << 31);

    /// Whether all bits of `inputs` are high.
    #[inline]
    pub fn contains(self, inputs: Self) -> bool {
        self.0 & inputs.0 == inputs.0
    }

    /// These inputs and `inputs` together.
    #[inline]
    #[must_use]
    pub fn with(self, inputs: Self) -> Self {
        Self(self.0 | inputs.0)
    }
}

/// Flags of the controller's state, one bit each.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "zero-copy", derive(ZeroCopySend))]
#[cfg_attr(feature = "zero-copy", type_name("painleve::StatusFlags"))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct StatusFlags(pub u16);

impl StatusFlags {
    /// The tip is taken to touch the belt.
    pub const CONTACT: Self = Self(1);
    /// The law asked for more torque than allowed.
    pub const SATURATED: Self = Self(1 << 1);
    /// The last segment of the reference has ended.
    pub const REFERENCE_DONE: Self = Self(1 << 2);
    /// The contact guard changed the torque to keep the tip pressed on the belt.
    pub const GUARDED: Self = Self(1 << 3);
    /// The reference is beyond the edge of the admissible stretch, and held there.
    pub const AT_EDGE: Self = Self(1 << 4);
    /// The tip is being brought back onto the belt.
    pub const RECOVERING: Self = Self(1 << 5);
    /// In contact: the tip seems to slide with ż_r < 0 (clear: ż_r > 0).
    pub const SLIP_NEGATIVE: Self = Self(1 << 6);
    /// In contact: the tip seems to move with the belt.
    pub const STICKS: Self = Self(1 << 7);

    /// Whether all bits of `flags` are set.
    #[inline]
    pub fn contains(self, flags: Self) -> bool {
        self.0 & flags.0 == flags.0
    }

    /// These flags with the bits of `flags` cleared.
    #[inline]
    #[must_use]
    pub fn without(self, flags: Self) -> Self {
        Self(self.0 & !flags.0)
    }

    /// Sets the bits of `flags` if `condition` holds.
    #[inline]
    pub fn set_if(&mut self, flags: Self, condition: bool) {
        if condition {
            self.0 |= flags.0;
        }
    }
}

/// One sample of everything the controller can measure.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
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
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
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
    /// The supervisor's state; `None` for a number this version does not know.
    pub fn supervisor_state(&self) -> Option<SupervisorState> {
        SupervisorState::from_code(self.state)
    }

    /// The latched fault, if any.
    pub fn latched_fault(&self) -> Option<Fault> {
        Fault::from_code(self.fault)
    }
}

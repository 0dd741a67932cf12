//! A board's record of its last reset, crash and fault, which outlives a reset.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::frame::{ActuatorFrame, SensorFrame};

/// Length of the end of a file's name that a [`Crash::Panic`] keeps, bytes.
pub const FILE_LENGTH: usize = 24;

/// Contents of a black box; lost when the power goes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BlackBox {
    /// Reason for the last start of the processor.
    pub reset: ResetCause,
    /// Number of starts since power came up.
    pub starts: u32,
    /// Reason for the last crash.
    pub crash: Option<Crash>,
    /// The tick that latched the last fault.
    pub fault: Option<FaultRecord>,
}

/// Reason for a reset.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ResetCause {
    /// The board does not report one.
    #[default]
    Unknown,
    /// The power came up, or the supply was too low.
    Power,
    /// A watchdog was not fed in time.
    Watchdog,
    /// The program requested it, after a crash.
    Software,
    /// The reset pin was low.
    Pin,
}

/// Reason for a crash of the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Crash {
    /// An instruction that cannot be executed, a bus that does not answer, or an access that is not permitted.
    HardFault {
        /// Address of the instruction.
        program_counter: u32,
        /// Address to which its function would have returned.
        link_register: u32,
        /// The processor's configurable fault status register.
        status: u32,
    },
    /// The crystal failed.
    Clock,
    /// The supply was too low, or an interrupt occurred that no peripheral in use raises.
    Interrupt {
        /// Number of the interrupt; negative for a processor exception.
        number: i16,
    },
    /// A defect in the program.
    Panic {
        /// Line of the source.
        line: u32,
        /// End of the source file's name, padded with zeros.
        file: [u8; FILE_LENGTH],
    },
    /// The stack overflowed.
    StackOverflow,
}

/// A tick that latched a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct FaultRecord {
    /// The readings.
    pub sensor: SensorFrame,
    /// The answer, with state and fault.
    pub answer: ActuatorFrame,
}

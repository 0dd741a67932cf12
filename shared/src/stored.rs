//! The configuration that a board keeps over a loss of power, to control its arm without a host.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Whether a board has a configuration of its own, and why not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum StoredState {
    /// Nothing is stored.
    #[default]
    Empty = 0,
    /// Stored and intact.
    Intact = 1,
    /// Stored by another build of the firmware: its bytes may mean something else.
    OtherBuild = 2,
    /// Stored and intact, but out of range for this controller.
    Refused = 3,
    /// The memory could not be erased or written.
    NotWritten = 4,
}

impl StoredState {
    /// Returns the number that the documentation lists.
    pub fn code(self) -> u8 {
        self as u8
    }

    /// Returns a description for the operator.
    pub fn text(self) -> &'static str {
        match self {
            Self::Empty => "nothing is stored",
            Self::Intact => "a configuration is stored; the board starts with it",
            Self::OtherBuild => "the stored configuration is of another build: store it again",
            Self::Refused => "the stored configuration is out of range: store another",
            Self::NotWritten => "the board's flash could not be written",
        }
    }
}

/// The configuration that a board has stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct StoredConfiguration {
    /// Whether it can be used.
    pub state: StoredState,
    /// Number of times that a configuration was stored, 0 without one.
    pub version: u32,
}

//! Drivers of the arm's sensors and switches over `embedded-hal`, and of its configuration's memory over
//! `embedded-storage`: the same code on the board and on a PC.
//!
//! - [`exchange`]: carries out a driver's exchanges on a SPI bus
//! - [`encoders`]: two or four AS5048A magnetic encoders on one SPI bus
//! - [`force_cell`]: one or two MCP3304 converters behind the force cell's bridge amplifiers
//! - [`switches`]: ENABLE and RESET, debounced
//! - [`checks`]: lets the checks below take turns
//! - [`front_end`]: sensor frames from readings and switches, and the permission to arm
//! - [`gap`]: checks encoders, force cell and torques against each other
//! - [`heating`]: estimates the temperature of the torque stages' windings
//! - [`plausibility`]: checks that readings can come from an arm before the drive is armed
//! - [`second_channel`]: compares two sensors of one quantity
//! - [`stages`]: codes of the torque stages' converter from joint torques, through motor and gear
//! - [`slots`]: keeps a configuration in flash over a loss of power
//!
//! A reading that a single disturbed bit could have changed is not passed on: each value is read twice, and
//! again in the same tick if the two differ. If they still differ, the reading is lost for this tick, and
//! the controller treats it like any other lost reading. Every call ends in bounded time.

#![no_std]

#[cfg(test)]
extern crate std;

pub mod checks;
pub mod encoders;
pub mod exchange;
pub mod force_cell;
pub mod front_end;
pub mod gap;
pub mod heating;
pub mod plausibility;
pub mod second_channel;
pub mod slots;
pub mod stages;
pub mod switches;

/// Ticks from one turn of a check to its next.
pub const TURNS: u8 = 5;

/// Reason for a missing reading in this tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReadError {
    /// The SPI bus or a select pin failed.
    Bus,
    /// A word with the wrong parity.
    Parity,
    /// The sensor reports a disturbance.
    Flagged,
    /// A bit that is always 0 was 1.
    NotZero,
    /// Two readings of the same value differ.
    Disagreement,
    /// No force gives this code: a supply or a wire is dead.
    Implausible,
}

/// Scales a reading of `from` bits to `to` bits.
fn rescale(counts: i32, from: u8, to: u8) -> i32 {
    if to < from {
        counts >> (from - to)
    } else {
        counts << (to - from)
    }
}

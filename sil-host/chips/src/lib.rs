//! Models of the boards' chips from their data sheets: sensors down to the bits on their wires, and
//! microcontrollers that execute an image instruction by instruction.
//!
//! - [`As5048a`], [`Mcp3304`]: the sensors' chips, on an SPI bus
//! - [`BridgeAmplifier`]: what the force cell puts on the inputs of its converter
//! - [`BitErrors`]: disturbs the bits on their wires
//! - [`wires`]: these parts behind `embedded-hal`, for drivers that run on a PC
//! - [`stm32f4`], [`stm32g4`]: the microcontrollers' peripherals, [`stm32`] what they have in common
//! - [`machine`]: exceptions, sleep, resets, time; [`system_control`]: the core's peripherals; [`protection`]: what
//!   memory may be used for
//! - [`registers`]: which registers and bits the chips have, by tables that others made
//! - [`unicorn`]: executes instructions
//!
//! The microcontrollers are not kinder than the manuals: [what these leave open](../README.md),
//! and what is not modelled.
//!
//! Time is counted in instructions: each takes [`machine::CYCLES_PER_INSTRUCTION`] of the clock
//! that the image has configured. It does not measure the time on silicon.

mod as5048a;
mod bit_band;
mod bit_errors;
mod bridge_amplifier;
pub mod machine;
mod mcp3304;
pub mod protection;
pub mod registers;
pub mod stm32;
pub mod stm32f4;
pub mod stm32g4;
pub mod system_control;
pub mod unicorn;
pub mod wires;

pub use as5048a::As5048a;
pub use bit_errors::BitErrors;
pub use bridge_amplifier::{BridgeAmplifier, BridgeFailure};
pub use mcp3304::Mcp3304;

/// Picoseconds.
pub type Picoseconds = u64;

/// One microsecond.
pub const MICROSECOND: Picoseconds = 1_000_000;

/// One millisecond.
pub const MILLISECOND: Picoseconds = 1_000_000_000;

/// One second.
pub const SECOND: Picoseconds = 1_000_000_000_000;

/// One transfer on an SPI bus, as seen by the master.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Transfer {
    /// Word sent by the master.
    pub value: u16,
    /// Length of the word, bits.
    pub bits: u8,
    /// Clock on the wire, Hz.
    pub hz: u64,
    /// Whether the clock idles high.
    pub idles_high: bool,
    /// Whether data are sampled at the clock's second edge.
    pub second_edge: bool,
    /// Time of the first clock edge.
    pub start: Picoseconds,
}

/// A part with a select line, low for selected.
pub trait SpiPart {
    /// Handles the falling edge of the select line.
    fn select(&mut self, now: Picoseconds);

    /// Handles the rising edge of the select line.
    fn deselect(&mut self, now: Picoseconds);

    /// Transfers a word while the part is selected and returns the part's answer; `now` is the end
    /// of the transfer.
    fn transfer(&mut self, transfer: &Transfer, now: Picoseconds) -> u16;

    /// Returns the data-sheet limits that the master has violated.
    fn violations(&self) -> &[&'static str];
}

//! The sensors' chips, modelled from their data sheets down to the bits on their wires, timing included.
//!
//! - [`As5048a`], [`Mcp3304`]: the parts, on a SPI bus
//! - [`BitErrors`]: disturbs what they send and receive
//! - [`wires`]: the parts behind `embedded-hal`, for drivers that run on a PC

mod as5048a;
mod bit_errors;
mod mcp3304;
pub mod wires;

pub use as5048a::As5048a;
pub use bit_errors::BitErrors;
pub use mcp3304::Mcp3304;

/// Picoseconds.
pub type Picoseconds = u64;

/// One second.
pub const SECOND: Picoseconds = 1_000_000_000_000;

/// One transfer on a SPI bus, seen from the master.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Transfer {
    /// What the master sends.
    pub value: u16,
    /// Its length.
    pub bits: u8,
    /// Clock on the wire, Hz.
    pub hz: u64,
    /// Clock idles high.
    pub idles_high: bool,
    /// Data are taken at the clock's second edge.
    pub second_edge: bool,
    /// When its first bit was clocked.
    pub start: Picoseconds,
}

/// A part with a select line, low for selected.
pub trait SpiPart {
    /// The select line goes low.
    fn select(&mut self, now: Picoseconds);

    /// The select line goes high.
    fn deselect(&mut self, now: Picoseconds);

    /// Bits pass while selected; `now` is their end. What the part sends.
    fn transfer(&mut self, transfer: &Transfer, now: Picoseconds) -> u16;

    /// Limits of the data sheet that the master has broken.
    fn violations(&self) -> &[&'static str];
}

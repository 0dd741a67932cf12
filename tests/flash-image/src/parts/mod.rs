//! The sensors on the board's SPI buses, modelled from their data sheets, timing included.

mod as5048a;
mod mcp3304;

pub use as5048a::As5048a;
pub use mcp3304::Mcp3304;

use crate::Picoseconds;
use crate::stm32f4::Transfer;

/// A part with a select line, low for selected.
pub trait SpiPart {
    /// The select line goes low.
    fn select(&mut self, now: Picoseconds);

    /// The select line goes high.
    fn deselect(&mut self, now: Picoseconds);

    /// Bits pass while selected; what the part sends.
    fn transfer(&mut self, transfer: &Transfer, now: Picoseconds) -> u16;
}

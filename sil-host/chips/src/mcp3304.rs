//! Microchip MCP3304, a converter of 13 bits with four differential pairs (data sheet DS21697).

use crate::{BitErrors, Picoseconds, SpiPart, Transfer};

/// Fastest clock at 5 V, Hz.
const FASTEST_HZ: u64 = 2_100_000;

/// Minimum time from select low to the first rising edge: 100 ns.
const SELECT_SETUP: Picoseconds = 100_000;

/// Minimum time of select high between two conversions: 475 ns.
const SELECT_HIGH: Picoseconds = 475_000;

/// One converter.
#[derive(Clone, Debug, Default)]
pub struct Mcp3304 {
    /// Voltages of the channels, counts of 1/4096 of the reference.
    pub channels: [i32; 8],
    /// Set if the lines are cut; they then read low (`Some(false)`) or high (`Some(true)`).
    pub dead: Option<bool>,
    /// Bit errors on the wires, in both directions.
    pub bit_errors: BitErrors,
    violations: Vec<&'static str>,
    /// Bits of the command after the start bit.
    command: u8,
    /// Number of bits since and including the start bit.
    clocked: u8,
    conversion: u16,
    selected: Option<Picoseconds>,
    deselected: Picoseconds,
    is_first: bool,
}

impl Mcp3304 {
    fn violate(&mut self, what: &'static str) {
        if !self.violations.contains(&what) {
            self.violations.push(what);
        }
    }

    /// Returns the 13-bit two's complement result of the selected channel or pair.
    fn convert(&self) -> u16 {
        let channel = usize::from(self.command & 7);
        let value = if self.command & 8 != 0 {
            // Single-ended inputs cannot go below ground.
            self.channels[channel].clamp(0, 4095)
        } else {
            (self.channels[channel] - self.channels[channel ^ 1]).clamp(-4096, 4095)
        };
        value as u16 & 0x1fff
    }
}

impl SpiPart for Mcp3304 {
    fn select(&mut self, now: Picoseconds) {
        if self.deselected != 0 && now < self.deselected + SELECT_HIGH {
            self.violate("MCP3304: select high for less than 475 ns");
        }
        self.selected = Some(now);
        self.clocked = 0;
        self.command = 0;
        self.is_first = true;
    }

    fn deselect(&mut self, now: Picoseconds) {
        if self.selected.take().is_some() {
            self.deselected = now;
        }
    }

    fn transfer(&mut self, transfer: &Transfer, now: Picoseconds) -> u16 {
        if transfer.hz > FASTEST_HZ {
            self.violate("MCP3304: clock beyond 2.1 MHz");
        }
        if transfer.idles_high != transfer.second_edge {
            self.violate("MCP3304: not in SPI mode 0 or 3");
        }
        let selected = self.selected.unwrap_or(now);
        if std::mem::take(&mut self.is_first) && transfer.start < selected + SELECT_SETUP {
            self.violate("MCP3304: clock less than 100 ns after select");
        }
        let mut answer = 0;
        for bit in (0..transfer.bits).rev() {
            let input = self.bit_errors.pass((transfer.value >> bit) & 1 != 0);
            let mut output = true;
            match self.clocked {
                0 if !input => {}
                0 => self.clocked = 1,
                clocks => {
                    if (1..=4).contains(&clocks) {
                        self.command = self.command << 1 | u8::from(input);
                    }
                    if clocks == 5 {
                        self.conversion = self.convert();
                    }
                    output = match clocks {
                        0..=5 => true,
                        // Null bit, sign, twelve bits; then the converter repeats them in reverse
                        // order.
                        6 => false,
                        7..=19 => self.conversion >> (19 - clocks) & 1 != 0,
                        _ => false,
                    };
                    self.clocked = clocks.saturating_add(1);
                }
            }
            output = self.bit_errors.pass(output);
            answer = answer << 1 | u16::from(self.dead.unwrap_or(output));
        }
        answer
    }

    fn violations(&self) -> &[&'static str] {
        &self.violations
    }
}

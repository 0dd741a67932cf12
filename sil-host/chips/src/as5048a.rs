//! ams AS5048A, a magnetic angle encoder of 14 bits (data sheet DS000298).

use crate::{BitErrors, Picoseconds, SpiPart, Transfer};

/// Fastest clock, Hz.
const FASTEST_HZ: u64 = 10_000_000;

/// Minimum times from select low to the first edge, from the last edge to select high, and of
/// select high between two frames: 350 ns.
const SETTLING: Picoseconds = 350_000;

const ERROR_FLAG: u16 = 1 << 14;

const PARITY_ERROR: u16 = 1 << 2;
const COMMAND_INVALID: u16 = 1 << 1;
const FRAMING_ERROR: u16 = 1;

const NOP: u16 = 0x0000;
const CLEAR_ERROR_FLAG: u16 = 0x0001;
const DIAGNOSTICS: u16 = 0x3ffd;
const MAGNITUDE: u16 = 0x3ffe;
const ANGLE: u16 = 0x3fff;

/// One encoder.
#[derive(Clone, Debug)]
pub struct As5048a {
    /// Angle of the magnet, counts.
    pub angle: u16,
    /// Diagnostics: magnet too weak (bit 11), too strong (10), overflow (9), compensation finished
    /// (8), gain.
    pub diagnostics: u16,
    /// Set if the lines are cut; they then read low (`Some(false)`) or high (`Some(true)`).
    pub dead: Option<bool>,
    /// Bit errors on the wires, in both directions.
    pub bit_errors: BitErrors,
    violations: Vec<&'static str>,
    /// Errors since they were last read.
    pub errors: u16,
    answer: u16,
    received: u32,
    sending: u16,
    bits: u8,
    selected: Option<Picoseconds>,
    deselected: Picoseconds,
    last_bit: Picoseconds,
}

impl Default for As5048a {
    fn default() -> Self {
        Self {
            angle: 0,
            // Offset compensation finished, gain at mid-scale.
            diagnostics: 0x0180,
            dead: None,
            bit_errors: BitErrors::default(),
            violations: Vec::new(),
            errors: 0,
            answer: 0,
            received: 0,
            sending: 0,
            bits: 0,
            selected: None,
            deselected: 0,
            last_bit: 0,
        }
    }
}

fn with_parity(word: u16) -> u16 {
    word & 0x7fff | ((word & 0x7fff).count_ones() as u16 & 1) << 15
}

impl As5048a {
    fn violate(&mut self, what: &'static str) {
        if !self.violations.contains(&what) {
            self.violations.push(what);
        }
    }

    fn execute(&mut self, command: u16) {
        let address = command & 0x3fff;
        let reads = command & 1 << 14 != 0;
        if !command.count_ones().is_multiple_of(2) {
            self.errors |= PARITY_ERROR;
        }
        let value = match address {
            _ if !command.count_ones().is_multiple_of(2) => 0,
            NOP => 0,
            CLEAR_ERROR_FLAG if reads => std::mem::take(&mut self.errors),
            DIAGNOSTICS if reads => self.diagnostics,
            MAGNITUDE if reads => 4000,
            ANGLE if reads => self.angle & 0x3fff,
            _ => {
                self.errors |= COMMAND_INVALID;
                0
            }
        };
        let error = if self.errors == 0 { 0 } else { ERROR_FLAG };
        self.answer = with_parity(value | error);
    }
}

impl SpiPart for As5048a {
    fn select(&mut self, now: Picoseconds) {
        if now < self.deselected + SETTLING && self.deselected != 0 {
            self.violate("AS5048A: select high for less than 350 ns");
        }
        self.selected = Some(now);
        self.bits = 0;
        self.received = 0;
        self.sending = self.answer;
    }

    fn deselect(&mut self, now: Picoseconds) {
        if self.selected.take().is_none() {
            return;
        }
        self.deselected = now;
        if self.bits > 0 && now < self.last_bit + SETTLING {
            self.violate("AS5048A: select held for less than 350 ns");
        }
        match self.bits {
            16 => self.execute(self.received as u16),
            0 => {}
            _ => {
                self.errors |= FRAMING_ERROR;
                self.answer = with_parity(ERROR_FLAG);
            }
        }
    }

    fn transfer(&mut self, transfer: &Transfer, now: Picoseconds) -> u16 {
        if transfer.hz > FASTEST_HZ {
            self.violate("AS5048A: clock beyond 10 MHz");
        }
        if transfer.idles_high || !transfer.second_edge {
            self.violate("AS5048A: not in SPI mode 1");
        }
        let selected = self.selected.unwrap_or(now);
        if self.bits == 0 && transfer.start < selected + SETTLING {
            self.violate("AS5048A: clock less than 350 ns after select");
        }
        let mut answer = 0;
        for bit in (0..transfer.bits).rev() {
            let input = self.bit_errors.pass((transfer.value >> bit) & 1 != 0);
            self.received = (self.received << 1) | u32::from(input);
            let mut out = self.sending & 0x8000 != 0;
            out = self.bit_errors.pass(out);
            answer = answer << 1 | u16::from(self.dead.unwrap_or(out));
            self.sending <<= 1;
        }
        self.bits = self.bits.saturating_add(transfer.bits);
        self.last_bit = now;
        answer
    }

    fn violations(&self) -> &[&'static str] {
        &self.violations
    }
}

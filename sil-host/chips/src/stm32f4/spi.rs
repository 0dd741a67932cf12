//! An SPI master (RM0090, section 28): polled, or with an interrupt for every received word.

use crate::stm32::check_spi_words;
use crate::{Picoseconds, SECOND, Transfer};

const ENABLED_MASTER: u32 = 1 << 6 | 1 << 2;
const RECEIVED: u32 = 1;
const EMPTY: u32 = 1 << 1;
const OVERRUN: u32 = 1 << 6;
const BUSY: u32 = 1 << 7;

/// Registers of an SPI.
#[derive(Clone, Debug)]
pub struct Spi {
    control: [u32; 2],
    received: u32,
    flags: u32,
    waiting: Option<u16>,
    shifting: Option<(Transfer, Picoseconds)>,
}

impl Default for Spi {
    fn default() -> Self {
        Self {
            control: [0, 0],
            received: 0,
            flags: EMPTY,
            waiting: None,
            shifting: None,
        }
    }
}

impl Spi {
    /// Handles a load.
    pub fn read(&mut self, offset: u32) -> u32 {
        match offset {
            0x00 => self.control[0],
            0x04 => self.control[1],
            0x08 => self.flags | if self.shifting.is_some() { BUSY } else { 0 },
            0x0c => {
                self.flags &= !(RECEIVED | OVERRUN);
                self.received
            }
            0x10 => 7,
            _ => 0,
        }
    }

    /// Handles a store, while the bus's clock runs at `clock_hz`.
    pub fn write(&mut self, offset: u32, value: u32, clock_hz: u64, now: Picoseconds) {
        match offset {
            0x00 => self.control[0] = value,
            0x04 => self.control[1] = value,
            0x0c if self.control[0] & ENABLED_MASTER == ENABLED_MASTER => {
                if self.shifting.is_none() {
                    self.begin(value as u16, clock_hz, now);
                } else {
                    self.waiting = Some(value as u16);
                    self.flags &= !EMPTY;
                }
            }
            _ => {}
        }
    }

    fn begin(&mut self, value: u16, clock_hz: u64, now: Picoseconds) {
        let [control, _] = self.control;
        check_spi_words(self.control);
        let divisor = 2_u64 << (control >> 3 & 7);
        let bits = if control & 1 << 11 != 0 { 16 } else { 8 };
        let transfer = Transfer {
            value: value & u16::MAX >> (16 - bits),
            bits,
            hz: clock_hz / divisor,
            idles_high: control & 2 != 0,
            second_edge: control & 1 != 0,
            start: now,
        };
        let ends = now + SECOND * u64::from(bits) * divisor / clock_hz.max(1);
        self.shifting = Some((transfer, ends));
        self.flags |= EMPTY;
    }

    /// Returns whether the interrupt line is high.
    pub fn interrupts(&self) -> bool {
        const RECEIVED_ENABLED: u32 = 1 << 6;
        self.flags & RECEIVED != 0 && self.control[1] & RECEIVED_ENABLED != 0
    }

    /// Returns the end of the present transfer.
    pub fn next_event(&self) -> Picoseconds {
        self.shifting.map_or(Picoseconds::MAX, |(_, ends)| ends)
    }

    /// Returns the transfer that has just ended; answer it with
    /// [`Spi::complete`].
    pub fn ended(&self, now: Picoseconds) -> Option<Transfer> {
        self.shifting
            .filter(|(_, ends)| *ends <= now)
            .map(|(transfer, _)| transfer)
    }

    /// Stores the answer to a transfer.
    pub fn complete(&mut self, received: u16, clock_hz: u64) {
        let ends = self.shifting.take().map_or(0, |(_, ends)| ends);
        if self.flags & RECEIVED != 0 {
            self.flags |= OVERRUN;
        } else {
            self.received = received.into();
            self.flags |= RECEIVED;
        }
        if let Some(value) = self.waiting.take() {
            self.begin(value, clock_hz, ends);
        }
    }
}

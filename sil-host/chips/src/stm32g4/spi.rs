//! An SPI master with FIFOs of four bytes (RM0440, chapter SPI): an access to the data register moves as many
//! bytes as it is wide, and words of up to eight bits take one byte each.

use std::collections::VecDeque;

use crate::stm32::check_spi_words;
use crate::{Picoseconds, SECOND, Transfer};

const ENABLED: u32 = 1 << 6;
const MASTER: u32 = 1 << 2;
const RECEIVED: u32 = 1;
const EMPTY: u32 = 1 << 1;
const OVERRUN: u32 = 1 << 6;
const BUSY: u32 = 1 << 7;
const RECEIVED_INTERRUPT: u32 = 1 << 6;
const QUARTER_THRESHOLD: u32 = 1 << 12;

/// Bytes of a FIFO.
const FIFO: usize = 4;

/// Registers of an SPI.
#[derive(Clone, Debug)]
pub struct Spi {
    control: [u32; 2],
    to_send: VecDeque<u8>,
    received: VecDeque<u8>,
    has_overrun: bool,
    shifting: Option<(Transfer, Picoseconds)>,
}

impl Default for Spi {
    fn default() -> Self {
        Self {
            control: [0, 0x700],
            to_send: VecDeque::new(),
            received: VecDeque::new(),
            has_overrun: false,
            shifting: None,
        }
    }
}

impl Spi {
    fn bits(&self) -> u8 {
        // Fewer than four bits are eight.
        match (self.control[1] >> 8 & 15) as u8 + 1 {
            0..4 => 8,
            bits => bits,
        }
    }

    fn has_received(&self) -> bool {
        let threshold = if self.control[1] & QUARTER_THRESHOLD != 0 {
            1
        } else {
            2
        };
        self.received.len() >= threshold
    }

    /// Handles a load of `size` bytes.
    pub fn read(&mut self, offset: u32, size: u32) -> u32 {
        match offset {
            0x00 => self.control[0],
            0x04 => self.control[1],
            0x08 => {
                let flag = |is_set: bool, bit: u32| if is_set { bit } else { 0 };
                let flags = flag(self.has_received(), RECEIVED)
                    | flag(self.to_send.len() <= FIFO / 2, EMPTY)
                    | flag(self.has_overrun, OVERRUN)
                    | flag(self.shifting.is_some(), BUSY);
                // Reading data, then flags, clears an overrun.
                self.has_overrun &= !self.received.is_empty();
                flags
            }
            0x0c => (0..size.min(2)).fold(0, |word, byte| {
                let next = self.received.pop_front().unwrap_or_default();
                word | u32::from(next) << (8 * byte)
            }),
            0x10 => 7,
            _ => 0,
        }
    }

    /// Handles a store of `size` bytes, while the bus's clock runs at `clock_hz`.
    pub fn write(
        &mut self,
        offset: u32,
        (value, size): (u32, u32),
        clock_hz: u64,
        now: Picoseconds,
    ) {
        match offset {
            0x00 => self.control[0] = value,
            0x04 => self.control[1] = value,
            0x0c if self.control[0] & ENABLED != 0 && self.control[0] & MASTER != 0 => {
                for byte in &value.to_le_bytes()[..size.min(2) as usize] {
                    if self.to_send.len() < FIFO {
                        self.to_send.push_back(*byte);
                    }
                }
                if self.shifting.is_none() {
                    self.begin(clock_hz, now);
                }
            }
            _ => {}
        }
    }

    fn begin(&mut self, clock_hz: u64, now: Picoseconds) {
        let bits = self.bits();
        let bytes = usize::from(bits).div_ceil(8);
        if self.to_send.len() < bytes {
            return;
        }
        let sent = self.to_send.drain(..bytes).enumerate();
        let value = sent.fold(0, |word, (n, byte)| word | u16::from(byte) << (8 * n));
        let [control, _] = self.control;
        check_spi_words(self.control);
        let divisor = 2_u64 << (control >> 3 & 7);
        let transfer = Transfer {
            value,
            bits,
            hz: clock_hz / divisor,
            idles_high: control & 2 != 0,
            second_edge: control & 1 != 0,
            start: now,
        };
        let ends = now + SECOND * u64::from(bits) * divisor / clock_hz.max(1);
        self.shifting = Some((transfer, ends));
    }

    /// Returns whether the interrupt line is high.
    pub fn interrupts(&self) -> bool {
        self.has_received() && self.control[1] & RECEIVED_INTERRUPT != 0
    }

    /// Returns the end of the present transfer.
    pub fn next_event(&self) -> Picoseconds {
        self.shifting.map_or(Picoseconds::MAX, |(_, ends)| ends)
    }

    /// Returns the transfer that has just ended; answer it with [`Spi::complete`].
    pub fn ended(&self, now: Picoseconds) -> Option<Transfer> {
        self.shifting
            .filter(|(_, ends)| *ends <= now)
            .map(|(transfer, _)| transfer)
    }

    /// Stores the answer to a transfer.
    pub fn complete(&mut self, received: u16, clock_hz: u64) {
        let Some((transfer, ends)) = self.shifting.take() else {
            return;
        };
        let bytes = usize::from(transfer.bits).div_ceil(8);
        if self.received.len() + bytes > FIFO {
            self.has_overrun = true;
        } else {
            self.received.extend(&received.to_le_bytes()[..bytes]);
        }
        self.begin(clock_hz, ends);
    }
}

//! The independent watchdog (RM0090, section 21): it runs from an oscillator between 17 and 47 kHz.

use crate::{Picoseconds, SECOND};

/// Registers of the watchdog.
#[derive(Clone, Debug)]
pub struct Watchdog {
    /// Its oscillator, Hz.
    pub oscillator_hz: u64,
    prescaler: u32,
    reload: u32,
    is_open: bool,
    expires: Picoseconds,
    /// When it was last fed.
    pub fed: Picoseconds,
}

impl Watchdog {
    /// Not started, on an oscillator of this rate.
    pub fn new(oscillator_hz: u64) -> Self {
        Self {
            oscillator_hz,
            prescaler: 0,
            reload: 0xfff,
            is_open: false,
            expires: Picoseconds::MAX,
            fed: 0,
        }
    }

    /// A load.
    pub fn read(&self, offset: u32) -> u32 {
        match offset {
            0x04 => self.prescaler,
            0x08 => self.reload,
            _ => 0,
        }
    }

    /// A store.
    pub fn write(&mut self, offset: u32, value: u32, now: Picoseconds) {
        match (offset, value) {
            (0x00, 0x5555) => self.is_open = true,
            (0x00, 0xcccc) => {
                self.expires = now;
                self.feed(now);
            }
            (0x00, 0xaaaa) => {
                self.is_open = false;
                self.feed(now);
            }
            (0x00, _) => self.is_open = false,
            (0x04, _) if self.is_open => self.prescaler = value & 7,
            (0x08, _) if self.is_open => self.reload = value & 0xfff,
            _ => {}
        }
    }

    fn feed(&mut self, now: Picoseconds) {
        self.fed = now;
        if self.expires != Picoseconds::MAX {
            let counts = (u64::from(self.reload) + 1) * (4 << self.prescaler.min(6));
            self.expires = now + counts * SECOND / self.oscillator_hz;
        }
    }

    /// When it resets the microcontroller.
    pub fn expires(&self) -> Picoseconds {
        self.expires
    }
}

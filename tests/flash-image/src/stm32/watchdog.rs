//! The watchdogs: the independent one (RM0090, section 21; RM0440, chapter IWDG) runs on an oscillator of its
//! own, the window watchdog (section 22; chapter WWDG) on the slow peripherals' clock.

use crate::{Picoseconds, SECOND};

/// Registers of the independent watchdog.
#[derive(Clone, Debug)]
pub struct Watchdog {
    /// Frequency of the watchdog's oscillator, Hz.
    pub oscillator_hz: u64,
    prescaler: u32,
    reload: u32,
    is_open: bool,
    expires: Picoseconds,
    /// Time of the last feeding.
    pub fed: Picoseconds,
}

impl Watchdog {
    /// Creates a stopped watchdog with an oscillator of this frequency.
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

    /// Handles a load.
    pub fn read(&self, offset: u32) -> u32 {
        match offset {
            0x04 => self.prescaler,
            0x08 => self.reload,
            _ => 0,
        }
    }

    /// Handles a store.
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

    /// Returns when the watchdog resets the microcontroller.
    pub fn expires(&self) -> Picoseconds {
        self.expires
    }
}

/// Registers of the window watchdog; the window is not modelled.
#[derive(Clone, Debug)]
pub struct WindowWatchdog {
    /// Position and mask of the prescaler in the configuration.
    prescaler: (u32, u32),
    control: u32,
    configuration: u32,
    expires: Option<Picoseconds>,
}

impl WindowWatchdog {
    /// Creates a stopped watchdog with its prescaler at this bit of the configuration, of `bits` bits.
    pub fn new(position: u32, bits: u32) -> Self {
        Self {
            prescaler: (position, (1 << bits) - 1),
            control: 0,
            configuration: 0,
            expires: None,
        }
    }

    /// Resets the registers.
    pub fn reset(&mut self) {
        self.control = 0;
        self.configuration = 0;
        self.expires = None;
    }

    /// Handles a load.
    pub fn read(&self, offset: u32) -> u32 {
        match offset {
            0x00 => self.control,
            0x04 => self.configuration,
            _ => 0,
        }
    }

    /// Handles a store.
    pub fn write(&mut self, offset: u32, value: u32, clock_hz: u64, now: Picoseconds) {
        match offset {
            0x00 => {
                // Once enabled, it stays enabled.
                self.control = value & 0x7f | (self.control | value) & 0x80;
                if self.control & 0x80 != 0 {
                    let counts = u64::from(self.control & 0x3f) + 1;
                    let (position, mask) = self.prescaler;
                    let cycles = counts << (12 + (self.configuration >> position & mask));
                    self.expires = Some(now + cycles * SECOND / clock_hz.max(1));
                }
            }
            0x04 => self.configuration = value,
            _ => {}
        }
    }

    /// Returns when the watchdog resets the microcontroller.
    pub fn expires(&self) -> Picoseconds {
        self.expires.unwrap_or(Picoseconds::MAX)
    }
}

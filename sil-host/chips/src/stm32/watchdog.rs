//! The watchdogs: the independent one (RM0090, section 21; RM0440, chapter IWDG) runs on an oscillator of its
//! own, the window watchdog (section 22; chapter WWDG) on the slow peripherals' clock.
//!
//! Where the manuals leave a time open, it is the longest, or depends on a phase that tests draw.

use crate::machine::Reset;
use crate::{Picoseconds, SECOND};

/// Longest time until a new limit of the independent watchdog takes effect, cycles of its oscillator.
const UPDATE_CYCLES: u64 = 5;

/// A register whose new value takes effect later.
#[derive(Clone, Copy, Debug)]
struct Delayed {
    before: u32,
    value: u32,
    from: Picoseconds,
}

impl Delayed {
    fn new(value: u32) -> Self {
        Self {
            before: value,
            value,
            from: 0,
        }
    }

    fn is_busy(&self, now: Picoseconds) -> bool {
        now < self.from
    }

    fn get(&self, now: Picoseconds) -> u32 {
        if self.is_busy(now) {
            self.before
        } else {
            self.value
        }
    }

    fn set(&mut self, value: u32, from: Picoseconds, now: Picoseconds) {
        assert!(!self.is_busy(now), "the last value has not taken effect");
        *self = Self {
            before: self.value,
            value,
            from,
        };
    }
}

/// Registers of the independent watchdog.
#[derive(Clone, Debug)]
pub struct Watchdog {
    /// Frequency of the watchdog's oscillator, Hz.
    pub oscillator_hz: u64,
    /// Phase of the oscillator at which limits are written; 0 is the worst.
    pub phase: Picoseconds,
    prescaler: Delayed,
    reload: Delayed,
    is_open: bool,
    expires: Picoseconds,
    /// Time of the last feeding.
    pub fed: Picoseconds,
    /// Whether it never expires, by a defect.
    pub is_dead: bool,
}

impl Watchdog {
    /// Creates a stopped watchdog with an oscillator of this frequency.
    pub fn new(oscillator_hz: u64) -> Self {
        Self {
            oscillator_hz,
            phase: 0,
            prescaler: Delayed::new(0),
            reload: Delayed::new(0xfff),
            is_open: false,
            expires: Picoseconds::MAX,
            fed: 0,
            is_dead: false,
        }
    }

    /// Stops the watchdog, as a reset does.
    pub fn reset(&mut self) {
        *self = Self {
            phase: self.phase,
            is_dead: self.is_dead,
            ..Self::new(self.oscillator_hz)
        };
    }

    /// Handles a load.
    pub fn read(&self, offset: u32, now: Picoseconds) -> u32 {
        match offset {
            0x04 => self.prescaler.get(now),
            0x08 => self.reload.get(now),
            0x0c => {
                u32::from(self.prescaler.is_busy(now)) | u32::from(self.reload.is_busy(now)) << 1
            }
            // The window is not modelled.
            0x10 => 0xfff,
            _ => 0,
        }
    }

    /// Handles a store.
    pub fn write(&mut self, offset: u32, value: u32, now: Picoseconds) {
        let cycle = SECOND / self.oscillator_hz;
        let from = now + UPDATE_CYCLES * cycle - self.phase % cycle;
        match (offset, value) {
            (0x00, key) => {
                self.is_open = key == 0x5555;
                match key {
                    // The manuals do not say that this key feeds a watchdog that already runs.
                    0xcccc if self.expires == Picoseconds::MAX => {
                        self.expires = now;
                        self.feed(now);
                    }
                    0xaaaa => self.feed(now),
                    _ => {}
                }
            }
            (0x04, _) if self.is_open => {
                self.prescaler.set(value & 7, from, now);
                self.expires = self.at_the_new_pace(self.expires);
            }
            (0x08, _) if self.is_open => self.reload.set(value & 0xfff, from, now),
            (0x10, _) => panic!("the independent watchdog's window is not modelled"),
            _ => {}
        }
    }

    fn cycles_per_count(prescaler: u32) -> u64 {
        4 << prescaler.min(6)
    }

    fn feed(&mut self, now: Picoseconds) {
        self.fed = now;
        if self.expires != Picoseconds::MAX {
            let counts = u64::from(self.reload.get(now)) + 1;
            let cycles = counts * Self::cycles_per_count(self.prescaler.get(now));
            self.expires = now + cycles * SECOND / self.oscillator_hz;
            if self.prescaler.is_busy(now) {
                self.expires = self.at_the_new_pace(self.expires);
            }
        }
    }

    /// Returns when counts expire whose pace changes with the prescaler.
    fn at_the_new_pace(&self, expires: Picoseconds) -> Picoseconds {
        let Delayed {
            before,
            value,
            from,
        } = self.prescaler;
        if expires == Picoseconds::MAX {
            return expires;
        }
        let left = expires.saturating_sub(from) / Self::cycles_per_count(before);
        expires.min(from) + left * Self::cycles_per_count(value)
    }

    /// Returns when the watchdog resets the microcontroller.
    pub fn expires(&self) -> Picoseconds {
        if self.is_dead {
            Picoseconds::MAX
        } else {
            self.expires
        }
    }
}

/// Registers of the window watchdog; the window is not modelled.
///
/// Its prescaler runs freely: feeding does not restart it. The first count after feeding is therefore shorter than
/// the others, by a time that nobody knows.
#[derive(Clone, Debug)]
pub struct WindowWatchdog {
    /// Position and mask of the prescaler in the configuration.
    prescaler: (u32, u32),
    /// Phase of the prescaler, cycles of its clock.
    pub phase: u64,
    /// Factor by which it is slower than it should be, by a defect; 0 for one that never expires.
    pub slowness: u64,
    control: u32,
    configuration: u32,
    expires: Option<Picoseconds>,
}

impl WindowWatchdog {
    /// Creates a stopped watchdog with its prescaler at this bit of the configuration, of `bits` bits.
    pub fn new(position: u32, bits: u32) -> Self {
        Self {
            prescaler: (position, (1 << bits) - 1),
            phase: 0,
            slowness: 1,
            control: 0x7f,
            configuration: 0x7f,
            expires: None,
        }
    }

    /// Resets the registers.
    pub fn reset(&mut self) {
        self.control = 0x7f;
        self.configuration = 0x7f;
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
                    self.expires = Some(self.expiry(clock_hz, now));
                }
            }
            0x04 => {
                // What is left to count stays, at the new pace.
                let left = self.expires.map(|at| {
                    let [now, end] = [now, at].map(|it| self.counted(clock_hz, it));
                    end.saturating_sub(now)
                });
                self.configuration = value;
                self.expires = left.map(|left| self.end(clock_hz, now, left));
            }
            _ => {}
        }
    }

    fn cycles_per_count(&self) -> u128 {
        let (position, mask) = self.prescaler;
        1 << (12 + (self.configuration >> position & mask))
    }

    fn clock_hz(&self, clock_hz: u64) -> u128 {
        (clock_hz / self.slowness.max(1)).max(1).into()
    }

    fn phase(&self) -> u128 {
        u128::from(self.phase) % self.cycles_per_count()
    }

    /// Returns the counts of the prescaler until this time.
    fn counted(&self, clock_hz: u64, now: Picoseconds) -> u128 {
        let cycles = u128::from(now) * self.clock_hz(clock_hz) / u128::from(SECOND);
        (cycles + self.phase()) / self.cycles_per_count()
    }

    /// Returns when the prescaler has counted this far from now.
    fn end(&self, clock_hz: u64, now: Picoseconds, counts: u128) -> Picoseconds {
        let counted = self.counted(clock_hz, now) + counts;
        let end = (counted * self.cycles_per_count()).saturating_sub(self.phase());
        (end * u128::from(SECOND)).div_ceil(self.clock_hz(clock_hz)) as Picoseconds
    }

    /// Returns when bit 6 of the counter falls.
    fn expiry(&self, clock_hz: u64, now: Picoseconds) -> Picoseconds {
        if self.control & 0x40 == 0 {
            return now;
        }
        self.end(clock_hz, now, u128::from(self.control & 0x3f) + 1)
    }

    /// Returns when the watchdog resets the microcontroller.
    pub fn expires(&self) -> Picoseconds {
        let expires = self.expires.filter(|_| self.slowness > 0);
        expires.unwrap_or(Picoseconds::MAX)
    }
}

/// Returns the reset of the watchdog that has expired, the first one if both have.
pub fn expired(own: &Watchdog, window: &WindowWatchdog, now: Picoseconds) -> Option<Reset> {
    let resets = [
        (own.expires(), Reset::Watchdog),
        (window.expires(), Reset::WindowWatchdog),
    ];
    let (at, reset) = resets.into_iter().min_by_key(|(at, _)| *at)?;
    (at <= now).then_some(reset)
}

//! TIM2, counting up (RM0090, section 18; RM0440, chapter TIM2).

use crate::{Picoseconds, SECOND};

/// Registers of a 32-bit timer.
#[derive(Clone, Debug)]
pub struct Timer {
    control: u32,
    interrupts: u32,
    flags: u32,
    /// The prescaler as written, and the one that counts since the last update.
    next_prescaler: u32,
    prescaler: u32,
    reload: u32,
    /// Count at `since`.
    count: u64,
    since: Picoseconds,
    /// Modes and edges of the first channel, and its capture.
    modes: u32,
    edges: u32,
    captured: u32,
    edges_seen: u32,
    /// Number of updates.
    pub updates: u64,
}

impl Default for Timer {
    fn default() -> Self {
        Self {
            control: 0,
            interrupts: 0,
            flags: 0,
            next_prescaler: 0,
            prescaler: 0,
            reload: u32::MAX,
            count: 0,
            since: 0,
            modes: 0,
            edges: 0,
            captured: 0,
            edges_seen: 0,
            updates: 0,
        }
    }
}

impl Timer {
    /// Resets the registers, as the clock control's reset of this peripheral does.
    pub fn reset(&mut self) {
        *self = Self {
            updates: self.updates,
            ..Self::default()
        };
    }

    fn runs(&self) -> bool {
        self.control & 1 != 0
    }

    /// Returns the time until the next update, from a count of `count`.
    fn count_ps(&self, counts: u64, hz: u64) -> Picoseconds {
        let counts = u128::from(counts) * u128::from(self.prescaler + 1);
        let time = counts * u128::from(SECOND) / u128::from(hz.max(1));
        time.try_into().unwrap_or(Picoseconds::MAX)
    }

    /// Captures the count at a falling edge of the first channel, if it is to.
    pub fn capture(&mut self, hz: u64, now: Picoseconds) {
        const OF_INPUT: u32 = 1;
        const FALLING_AND_ENABLED: u32 = 3;
        if self.modes & 3 != OF_INPUT || self.edges & 3 != FALLING_AND_ENABLED {
            return;
        }
        self.edges_seen += 1;
        if self.edges_seen.is_multiple_of(1 << (self.modes >> 2 & 3)) {
            self.captured = self.read(0x24, hz, now);
            self.flags |= 2;
        }
    }

    /// Returns the last capture; its flag is cleared.
    pub fn take_capture(&mut self) -> u32 {
        self.flags &= !2;
        self.captured
    }

    /// Takes the present count as the one from which time is counted; parts of a count stay.
    fn settle(&mut self, hz: u64, now: Picoseconds) {
        if self.runs() {
            let passed = self.counts_since(hz, now);
            self.count = (self.count + passed) & u64::from(u32::MAX);
            self.since += self.count_ps(passed, hz);
        } else {
            self.since = now;
        }
    }

    fn counts_since(&self, hz: u64, now: Picoseconds) -> u64 {
        let passed = u128::from(now - self.since) * u128::from(hz) / u128::from(SECOND);
        (passed / u128::from(self.prescaler + 1)) as u64
    }

    /// Handles a load.
    pub fn read(&self, offset: u32, hz: u64, now: Picoseconds) -> u32 {
        match offset {
            0x00 => self.control,
            0x0c => self.interrupts,
            0x10 => self.flags,
            0x18 => self.modes,
            0x20 => self.edges,
            0x34 => self.captured,
            0x24 if self.runs() => (self.count + self.counts_since(hz, now)) as u32,
            0x24 => self.count as u32,
            0x28 => self.next_prescaler,
            0x2c => self.reload,
            _ => 0,
        }
    }

    /// Handles a store.
    pub fn write(&mut self, offset: u32, value: u32, hz: u64, now: Picoseconds) {
        match offset {
            0x00 => {
                assert_eq!(value & !1, 0, "a mode of the timer that is not modelled");
                self.settle(hz, now);
                self.control = value;
            }
            0x0c => self.interrupts = value,
            0x10 => self.flags &= value,
            0x14 if value & 1 != 0 => self.update(now),
            0x24 => {
                self.count = value.into();
                self.since = now;
            }
            0x18 => self.modes = value,
            0x20 => {
                self.edges = value;
                // Without the channel, its prescaler is at its start.
                self.edges_seen *= value & 1;
            }
            0x28 => self.next_prescaler = value,
            0x2c => {
                self.settle(hz, now);
                self.reload = value;
            }
            _ => {}
        }
    }

    /// Returns the time of the next overflow. A count beyond the reload passes 2^32 first, and no event comes with that.
    pub fn next_event(&self, hz: u64) -> Picoseconds {
        if self.runs() && hz > 0 {
            let end = u64::from(self.reload) + 1;
            let is_beyond = self.count >= end;
            let left = end + (u64::from(is_beyond) << 32) - self.count;
            self.since.saturating_add(self.count_ps(left, hz))
        } else {
            Picoseconds::MAX
        }
    }

    /// Performs due events.
    pub fn advance(&mut self, hz: u64, now: Picoseconds) {
        while self.next_event(hz) <= now {
            self.update(self.next_event(hz));
            self.updates += 1;
        }
    }

    /// The update event.
    fn update(&mut self, now: Picoseconds) {
        self.since = now;
        self.count = 0;
        self.prescaler = self.next_prescaler;
        self.flags |= 1;
    }

    /// Returns whether the interrupt line is high.
    pub fn interrupts(&self) -> bool {
        self.flags & self.interrupts & 1 != 0
    }
}

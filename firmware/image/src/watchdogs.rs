//! Settings of an STM32's two watchdogs.
//!
//! The window watchdog runs on the processor's clock and resets the chip one and a half periods after the last
//! finished tick. The independent watchdog runs on its own oscillator and covers a failure of the clock itself.

/// Keys of the independent watchdog.
pub mod key {
    /// Starts it, for good.
    pub const START: u16 = 0xcccc;
    /// Permits to change its limit.
    pub const OPEN: u16 = 0x5555;
    /// Restarts its time.
    pub const FEED: u16 = 0xaaaa;
}

/// Cycles of the slow peripherals' clock per count of the window watchdog.
const WINDOW_CYCLES: f32 = 4096.0;

/// Limit of an independent watchdog.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IndependentLimit {
    /// Counts of 4 · 2ⁿ cycles.
    pub prescaler: u8,
    /// Counts, of twelve bits.
    pub reload: u16,
}

impl IndependentLimit {
    /// Returns the shortest limit of at least `limit_s`, whose oscillator has at most `fastest_hz`.
    pub fn new(limit_s: f32, fastest_hz: f32) -> Self {
        // Counts of four cycles, doubled until they fit into twelve bits.
        let mut counts = limit_s * fastest_hz / 4.0;
        let mut prescaler = 0;
        while counts > 4096.0 && prescaler < 6 {
            counts /= 2.0;
            prescaler += 1;
        }
        let reload = (counts as u16).clamp(1, 4095);
        Self { prescaler, reload }
    }
}

/// Limit of a window watchdog.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WindowLimit {
    /// Counts of 4096 · 2ⁿ cycles.
    pub prescaler: u8,
    /// The counter after feeding: the chip is reset when its bit 6 falls.
    pub counter: u8,
}

impl WindowLimit {
    /// Returns the limit of one and a half periods, on a bus of `bus_hz`, with prescalers up to
    /// `largest_prescaler`; `None` for periods that are too long.
    pub fn new(period_s: f32, bus_hz: f32, largest_prescaler: u8) -> Option<Self> {
        let mut counts = 1.5 * period_s * bus_hz / WINDOW_CYCLES;
        let mut prescaler = 0;
        while counts > 63.0 && prescaler < largest_prescaler {
            counts /= 2.0;
            prescaler += 1;
        }
        let counter = 0x40 | counts as u8;
        (counts <= 63.0).then_some(Self { prescaler, counter })
    }
}

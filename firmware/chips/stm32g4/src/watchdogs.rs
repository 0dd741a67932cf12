//! The two watchdogs (RM0440, chapters IWDG and WWDG), fed at the end of every control tick.

#![allow(unsafe_code)] // fields without named values

use painleve_image::watchdogs::{IndependentLimit, WindowLimit, key};

use crate::{PATIENCE, comes, pac};

/// Highest frequency of the independent watchdog's oscillator, Hz (the lowest is 29.5 kHz; DS12288,
/// LSI characteristics).
const FASTEST_OSCILLATOR_HZ: f32 = 34_000.0;

/// Largest prescaler of the window watchdog.
const LARGEST_WINDOW_PRESCALER: u8 = 7;

fn write_key(watchdog: &pac::IWDG, key: u16) {
    // SAFETY: one of the three keys.
    watchdog.kr().write(|w| unsafe { w.key().bits(key) });
}

/// Both watchdogs. The independent one resets the chip after 2 to 2.4 periods.
pub struct Watchdogs {
    independent: pac::IWDG,
    window: pac::WWDG,
    bus_hz: f32,
    /// `None` for rates too low for the window watchdog.
    limit: Option<WindowLimit>,
}

impl Watchdogs {
    /// Starts the independent watchdog with a timeout of at least `limit_s`. Call it before anything that
    /// may hang.
    pub fn start_independent(independent: &pac::IWDG, limit_s: f32) {
        let limit = IndependentLimit::new(limit_s, FASTEST_OSCILLATOR_HZ);
        write_key(independent, key::START);
        write_key(independent, key::OPEN);
        // SAFETY: every value of three bits up to 6 is a prescaler, and of twelve bits a reload.
        unsafe {
            independent.pr().write(|w| w.pr().bits(limit.prescaler));
            independent.rlr().write(|w| w.rl().bits(limit.reload));
        }
        // Both registers take effect in the oscillator's time, after some 200 µs.
        comes(PATIENCE, || independent.sr().read().bits() == 0);
        write_key(independent, key::FEED);
    }

    /// Takes ownership of both watchdogs; `bus_hz` is the clock of APB1. The window watchdog's own clock must
    /// be on.
    pub fn new(independent: pac::IWDG, window: pac::WWDG, bus_hz: u32) -> Self {
        Self {
            independent,
            window,
            bus_hz: bus_hz as f32,
            limit: None,
        }
    }

    /// Sets the timeout to one and a half of these periods.
    pub fn set_period(&mut self, period_s: f32) {
        Self::start_independent(&self.independent, 2.0 * period_s);
        let Some(limit) = WindowLimit::new(period_s, self.bus_hz, LARGEST_WINDOW_PRESCALER) else {
            // The running window watchdog cannot be stopped, and would reset the chip too early.
            return;
        };
        self.limit = Some(limit);
        // SAFETY: prescalers have three bits; a window of 0x7f disables the window.
        self.window
            .cfr()
            .write(|w| unsafe { w.wdgtb().bits(limit.prescaler).w().bits(0x7f) });
        self.feed();
    }

    /// Feeds both watchdogs when a tick is finished.
    pub fn feed(&mut self) {
        write_key(&self.independent, key::FEED);
        if let Some(WindowLimit { counter, .. }) = self.limit {
            // SAFETY: seven bits.
            self.window
                .cr()
                .write(|w| unsafe { w.t().bits(counter).wdga().set_bit() });
        }
    }
}

//! Registers of the two watchdogs (RM0440, chapters IWDG and WWDG).

#![allow(unsafe_code)] // fields without named values

use painleve_image::watchdogs::{IndependentLimit, IndependentWatchdog, WindowWatchdog};

use crate::pac;

/// The independent watchdog. Its oscillator has 29.5 to 34 kHz (DS12288, LSI characteristics), and it counts four of its
/// cycles: it resets the chip after 2 to 2.5 periods up to 1 kHz, and after at most 6 at the highest rate.
pub struct Independent(pub pac::IWDG);

impl IndependentWatchdog for Independent {
    const FASTEST_HZ: f32 = 34_000.0;

    fn write_key(&self, key: u16) {
        // SAFETY: one of the three keys.
        self.0.kr().write(|w| unsafe { w.key().bits(key) });
    }

    fn set(&self, limit: IndependentLimit) {
        // SAFETY: every value of three bits up to 6 is a prescaler, and of twelve bits a reload.
        unsafe {
            self.0.pr().write(|w| w.pr().bits(limit.prescaler));
            self.0.rlr().write(|w| w.rl().bits(limit.reload));
        }
    }

    fn is_set(&self) -> bool {
        self.0.sr().read().bits() == 0
    }
}

/// The window watchdog.
pub struct Window(pub pac::WWDG);

impl WindowWatchdog for Window {
    const LARGEST_PRESCALER: u8 = 7;
    const LATEST_FEED_S: f32 = 15e-6;

    fn set_prescaler(&self, prescaler: u8) {
        // SAFETY: prescalers have three bits; a window of 0x7f disables the window.
        self.0
            .cfr()
            .write(|w| unsafe { w.wdgtb().bits(prescaler).w().bits(0x7f) });
    }

    fn feed(&self, counter: u8) {
        // SAFETY: seven bits.
        self.0
            .cr()
            .write(|w| unsafe { w.t().bits(counter).wdga().set_bit() });
    }
}

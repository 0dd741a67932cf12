//! Both watchdogs (RM0090, chapters IWDG and WWDG).

#![allow(unsafe_code)] // fields without named values

use painleve_image::watchdogs::{IndependentLimit, IndependentWatchdog, WindowWatchdog};
use stm32f4xx_hal::pac;

/// The independent watchdog. Its oscillator has 17 to 47 kHz, and it counts four of its cycles: it resets the chip after 2 to
/// 6 periods up to 1 kHz, and after at most 7 at the highest rates.
pub struct Independent(pub pac::IWDG);

impl IndependentWatchdog for Independent {
    const FASTEST_HZ: f32 = 47_000.0;

    fn write_key(&self, key: u16) {
        // SAFETY: one of the three keys.
        self.0.kr().write(|w| unsafe { w.key().bits(key) });
    }

    fn set(&self, limit: IndependentLimit) {
        // SAFETY: every value of three bits up to 6 is a prescaler, and of twelve bits a reload.
        unsafe {
            self.0.pr().write(|w| w.bits(limit.prescaler.into()));
            self.0.rlr().write(|w| w.bits(limit.reload));
        }
    }

    fn is_set(&self) -> bool {
        self.0.sr().read().bits() == 0
    }
}

/// The window watchdog.
pub struct Window(pub pac::WWDG);

impl WindowWatchdog for Window {
    const LARGEST_PRESCALER: u8 = 3;
    const LATEST_FEED_S: f32 = 10e-6;

    fn set_prescaler(&self, prescaler: u8) {
        // SAFETY: prescalers have two bits; a window of 0x7f disables the window.
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

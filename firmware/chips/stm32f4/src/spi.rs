//! The words of a SPI (RM0090, section 28).

use core::ops::Deref;

use painleve_image::sensor_bus::{Overrun, SpiWords};
use stm32f4xx_hal::pac::spi1::RegisterBlock;

/// A SPI that is configured as a master.
pub struct SpiPort<I>(pub I);

impl<I: Deref<Target = RegisterBlock>> SpiWords for SpiPort<I> {
    fn start(&mut self) {
        self.0.cr2().modify(|_, w| w.rxneie().set_bit());
        self.0.cr1().modify(|_, w| w.spe().set_bit());
    }

    fn send(&mut self, word: u16) {
        self.0.dr().write(|w| w.dr().set(word));
    }

    fn receive(&mut self) -> Option<Result<u16, Overrun>> {
        let flags = self.0.sr().read();
        if flags.rxne().bit_is_clear() {
            return None;
        }
        let word = self.0.dr().read().bits();
        if flags.ovr().bit_is_set() {
            // Reading data, then flags, clears an overrun.
            let _ = self.0.sr().read();
            return Some(Err(Overrun));
        }
        Some(Ok(word))
    }

    fn discard(&mut self) {
        let _ = self.0.dr().read();
    }
}

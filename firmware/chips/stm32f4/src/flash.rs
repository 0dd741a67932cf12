//! The last two sectors of the flash, each a slot for a configuration (RM0090, section 3.6).
//!
//! Nothing can be read from the flash while a sector is erased, for a second or two. Program and vectors are in
//! RAM (`program_memory`), so that control and watchdogs go on.

#![allow(unsafe_code)] // fields without named values

use embedded_storage::nor_flash::NorFlashErrorKind;
use painleve_image::flash::FlashRegisters;
use stm32f4xx_hal::pac::FLASH;

/// Keys that open the control register (RM0090, section 3.6.1).
const KEYS: [u32; 2] = [0x4567_0123, 0xcdef_89ab];

/// Number of polls for an erasure: more than 4 s, the longest of the data sheet, at eight cycles a poll.
pub(crate) const PATIENCE: u32 = 100_000_000;

/// Errors of an operation in the status register.
pub(crate) const ERRORS: u32 = 0xf2;

/// Stores of four bytes at a time need a supply of 2.7 V, below which the chip is held in reset.
const WORDS: u8 = 2;

/// The flash's registers.
pub struct Registers(pub FLASH);

impl FlashRegisters for Registers {
    const START: u32 = 0x080c_0000;
    const FIRST_SECTOR: u8 = 10;
    const SECTOR: usize = 128 << 10;
    const WORD: usize = 4;

    fn open(&mut self) -> Result<(), NorFlashErrorKind> {
        self.wait()?;
        for key in KEYS {
            // SAFETY: the keys of the manual, in its order.
            self.0.keyr().write(|w| unsafe { w.bits(key) });
        }
        Ok(())
    }

    fn close(&mut self) {
        self.0.cr().write(|w| w.lock().set_bit());
        self.0.acr().modify(|_, w| w.dcen().clear_bit());
        self.0.acr().modify(|_, w| w.dcrst().set_bit());
        self.0
            .acr()
            .modify(|_, w| w.dcrst().clear_bit().dcen().set_bit());
    }

    fn erase(&mut self, sector: u8) {
        // SAFETY: numbers of a sector and of a width.
        self.0.cr().write(|w| unsafe {
            w.lock().clear_bit().psize().bits(WORDS);
            w.ser().set_bit().snb().bits(sector)
        });
        self.0.cr().modify(|_, w| w.strt().set_bit());
    }

    fn permit_writing(&mut self) {
        // SAFETY: the number of a width.
        self.0.cr().write(|w| unsafe {
            w.lock().clear_bit().psize().bits(WORDS);
            w.pg().set_bit()
        });
    }

    #[inline(never)]
    fn wait(&mut self) -> Result<(), NorFlashErrorKind> {
        let flash = &self.0;
        let is_done = (0..PATIENCE).any(|_| flash.sr().read().bsy().bit_is_clear());
        let errors = flash.sr().read().bits() & ERRORS;
        // SAFETY: writing one clears an error.
        flash.sr().write(|w| unsafe { w.bits(errors) });
        if is_done && errors == 0 {
            Ok(())
        } else {
            Err(NorFlashErrorKind::Other)
        }
    }
}

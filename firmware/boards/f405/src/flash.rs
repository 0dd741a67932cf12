//! The last two sectors of the flash, each a slot for a configuration (RM0090, section 3.6).
//!
//! Nothing can be read from the flash while a sector is erased, for a second or two. Program and vectors are in
//! RAM (`program_memory`), so that control and watchdogs go on.

#![allow(unsafe_code)] // memory-mapped flash

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash, check_erase, check_read, check_write,
};
use stm32f4xx_hal::pac::FLASH;

/// Address of the slots, which `memory.x` keeps free of program.
const START: u32 = 0x080c_0000;

/// Number of the first of them.
const FIRST_SECTOR: u8 = 10;

/// Length of a sector, bytes.
const SECTOR: usize = 128 << 10;

/// Keys that open the control register (RM0090, section 3.6.1).
const KEYS: [u32; 2] = [0x4567_0123, 0xcdef_89ab];

/// Number of polls for an erasure: more than 4 s, the longest of the data sheet, at eight cycles a poll.
const PATIENCE: u32 = 100_000_000;

/// Stores of four bytes at a time need a supply of 2.7 V, below which the chip is held in reset.
const WORDS: u8 = 2;

/// The slots.
pub struct ConfigurationFlash(FLASH);

impl ConfigurationFlash {
    /// Takes ownership of the flash's registers.
    pub fn new(flash: FLASH) -> Self {
        Self(flash)
    }

    /// Opens the control register, carries out the change, and closes the register.
    fn change(
        &mut self,
        change: impl FnOnce(&mut Self) -> Result<(), NorFlashErrorKind>,
    ) -> Result<(), NorFlashErrorKind> {
        self.wait()?;
        for key in KEYS {
            // SAFETY: the keys of the manual, in its order.
            self.0.keyr().write(|w| unsafe { w.bits(key) });
        }
        let result = change(self);
        self.0.cr().write(|w| w.lock().set_bit());
        // The data cache may hold what was there before.
        self.0.acr().modify(|_, w| w.dcen().clear_bit());
        self.0.acr().modify(|_, w| w.dcrst().set_bit());
        self.0
            .acr()
            .modify(|_, w| w.dcrst().clear_bit().dcen().set_bit());
        result
    }

    /// Waits for the end of an operation, and takes its errors.
    #[inline(never)]
    fn wait(&mut self) -> Result<(), NorFlashErrorKind> {
        const ERRORS: u32 = 0xf2;
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

impl ErrorType for ConfigurationFlash {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for ConfigurationFlash {
    const READ_SIZE: usize = 1;

    #[inline(never)]
    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        check_read(self, offset, bytes.len())?;
        let mut address = START + offset;
        for byte in bytes {
            // SAFETY: within the slots.
            *byte = unsafe { (address as *const u8).read_volatile() };
            address += 1;
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        2 * SECTOR
    }
}

impl NorFlash for ConfigurationFlash {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR;

    #[inline(never)]
    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        check_erase(self, from, to)?;
        let [first, end] = [from, to].map(|it| FIRST_SECTOR + (it / SECTOR as u32) as u8);
        self.change(|flash| {
            for sector in first..end {
                // SAFETY: numbers of a sector and of a width.
                flash.0.cr().write(|w| unsafe {
                    w.lock().clear_bit().psize().bits(WORDS);
                    w.ser().set_bit().snb().bits(sector)
                });
                flash.0.cr().modify(|_, w| w.strt().set_bit());
                flash.wait()?;
            }
            Ok(())
        })
    }

    #[inline(never)]
    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        check_write(self, offset, bytes.len())?;
        self.change(|flash| {
            // SAFETY: the number of a width.
            flash.0.cr().write(|w| unsafe {
                w.lock().clear_bit().psize().bits(WORDS);
                w.pg().set_bit()
            });
            let mut address = START + offset;
            for word in bytes.as_chunks().0 {
                // SAFETY: within the slots, which nothing else refers to.
                unsafe { (address as *mut u32).write_volatile(u32::from_le_bytes(*word)) };
                flash.wait()?;
                address += 4;
            }
            Ok(())
        })
    }
}

//! The last two pages of a STM32G4 with 512 KiB of flash in two banks, each page a slot for a configuration
//! (RM0440, chapter FLASH for category 3). The program in the other bank runs on while they are erased or
//! written.
//!
//! A double word whose writing was interrupted raises the non-maskable interrupt when it is read:
//! [`take_fault`].

#![allow(unsafe_code)] // memory-mapped flash

use core::sync::atomic::{AtomicBool, Ordering};

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash, check_erase, check_read, check_write,
};

use crate::supply::FLASH_KEYS;
use crate::{comes, pac};

/// Address of the slots, which the board's `memory.x` keeps free of program.
const START: u32 = 0x0807_f000;

/// Number of the first of their pages in the second bank.
const FIRST_PAGE: u8 = 126;

/// Length of a page, bytes.
const PAGE: usize = 2 << 10;

/// Number of polls for an erasure: more than 25 ms, the longest of the data sheet.
const PATIENCE: u32 = 10_000_000;

/// Whether the slots are being read.
static IS_READING: AtomicBool = AtomicBool::new(false);

/// Clears the fault of a double word of the slots that cannot be corrected; returns whether that was the reason
/// for the non-maskable interrupt. Its content then fails the check of its slot.
pub fn take_fault() -> bool {
    // SAFETY: a register that nothing else uses.
    let ecc = unsafe { (*pac::FLASH::ptr()).eccr() };
    let is_ours = IS_READING.load(Ordering::Relaxed) && ecc.read().eccd().bit_is_set();
    if is_ours {
        ecc.modify(|_, w| w.eccd().set_bit());
    }
    is_ours
}

/// The slots.
pub struct ConfigurationFlash(pac::FLASH);

impl ConfigurationFlash {
    /// Takes ownership of the flash's registers.
    pub fn new(flash: pac::FLASH) -> Self {
        Self(flash)
    }

    /// Opens the control register, carries out the change, and closes the register.
    fn change(
        &mut self,
        change: impl FnOnce(&mut Self) -> Result<(), NorFlashErrorKind>,
    ) -> Result<(), NorFlashErrorKind> {
        // As a single bank, the flash has other pages.
        if self.0.optr().read().dbank().is_single_bank_mode() {
            return Err(NorFlashErrorKind::Other);
        }
        self.wait().or_else(|_| self.wait())?;
        for key in FLASH_KEYS {
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
        const ERRORS: u32 = 0xc3fa;
        let flash = &self.0;
        let is_done = comes(PATIENCE, || flash.sr().read().bsy().bit_is_clear());
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
        IS_READING.store(true, Ordering::Relaxed);
        let mut address = START + offset;
        for byte in bytes {
            // SAFETY: within the slots.
            *byte = unsafe { (address as *const u8).read_volatile() };
            address += 1;
        }
        cortex_m::asm::dsb();
        IS_READING.store(false, Ordering::Relaxed);
        Ok(())
    }

    fn capacity(&self) -> usize {
        2 * PAGE
    }
}

impl NorFlash for ConfigurationFlash {
    const WRITE_SIZE: usize = 8;
    const ERASE_SIZE: usize = PAGE;

    #[inline(never)]
    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        check_erase(self, from, to)?;
        let [first, end] = [from, to].map(|it| FIRST_PAGE + (it / PAGE as u32) as u8);
        self.change(|flash| {
            for page in first..end {
                flash.0.cr().write(|w| {
                    // SAFETY: the number of a page.
                    unsafe { w.pnb().bits(page) };
                    w.lock().clear_bit().per().set_bit().bker().set_bit()
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
            flash.0.cr().write(|w| w.lock().clear_bit().pg().set_bit());
            let mut address = START + offset;
            for double_word in bytes.as_chunks::<8>().0 {
                for word in double_word.as_chunks().0 {
                    // SAFETY: within the slots, which nothing else refers to.
                    unsafe { (address as *mut u32).write_volatile(u32::from_le_bytes(*word)) };
                    address += 4;
                }
                flash.wait()?;
            }
            Ok(())
        })
    }
}

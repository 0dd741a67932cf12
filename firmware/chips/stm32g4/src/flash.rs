//! The last two pages of a STM32G4 with 512 KiB of flash in two banks, each page a slot for a configuration
//! (RM0440, chapter FLASH for category 3). The program in the other bank runs on while they are erased or
//! written.
//!
//! A double word whose writing was interrupted raises the non-maskable interrupt when it is read:
//! [`take_fault`].

#![allow(unsafe_code)] // registers, and fields without named values

use core::sync::atomic::{AtomicBool, Ordering, compiler_fence};

use embedded_storage::nor_flash::NorFlashErrorKind;
use painleve_image::flash::FlashRegisters;

use crate::{comes, pac};

/// Number of polls for an erasure: more than 25 ms, the longest of the data sheet.
pub(crate) const PATIENCE: u32 = 10_000_000;

/// Keys that open the control register (RM0440, chapter FLASH: "Unlocking the flash memory").
pub(crate) const KEYS: [u32; 2] = [0x4567_0123, 0xcdef_89ab];

/// Errors of an operation in the status register.
pub(crate) const ERRORS: u32 = 0xc3fa;

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

/// The flash's registers.
pub struct Registers(pub pac::FLASH);

impl FlashRegisters for Registers {
    const START: u32 = 0x0807_f000;
    /// A page of the second bank.
    const FIRST_SECTOR: u8 = 126;
    const SECTOR: usize = 2 << 10;
    const WORD: usize = 8;

    fn open(&mut self) -> Result<(), NorFlashErrorKind> {
        // As a single bank, the flash has other pages.
        if self.0.optr().read().dbank().is_single_bank_mode() {
            return Err(NorFlashErrorKind::Other);
        }
        self.wait().or_else(|_| self.wait())?;
        // Reading one bank while the other one is written may corrupt the data cache (ES0430, section 2.2.2).
        self.0.acr().modify(|_, w| w.dcen().clear_bit());
        for key in KEYS {
            // SAFETY: the keys of the manual, in its order.
            self.0.keyr().write(|w| unsafe { w.bits(key) });
        }
        Ok(())
    }

    fn close(&mut self) {
        self.0.cr().write(|w| w.lock().set_bit());
        self.0.acr().modify(|_, w| w.dcrst().set_bit());
        self.0.acr().modify(|_, w| w.dcrst().clear_bit());
        self.0.acr().modify(|_, w| w.dcen().set_bit());
    }

    fn erase(&mut self, page: u8) {
        self.0.cr().write(|w| {
            // SAFETY: the number of a page.
            unsafe { w.pnb().bits(page) };
            w.lock().clear_bit().per().set_bit().bker().set_bit()
        });
        self.0.cr().modify(|_, w| w.strt().set_bit());
    }

    fn permit_writing(&mut self) {
        self.0.cr().write(|w| w.lock().clear_bit().pg().set_bit());
    }

    #[inline(never)]
    fn wait(&mut self) -> Result<(), NorFlashErrorKind> {
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

    fn reading(&mut self, read: impl FnOnce()) {
        IS_READING.store(true, Ordering::Relaxed);
        // Keeps the loads, which may raise the interrupt, after the store.
        compiler_fence(Ordering::SeqCst);
        read();
        cortex_m::asm::dsb();
        IS_READING.store(false, Ordering::Relaxed);
    }
}

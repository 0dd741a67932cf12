//! Monitoring of the supply (RM0440, chapter PWR: "Power supply supervisor").

#![allow(unsafe_code)] // keys, interrupt priorities

use cortex_m::peripheral::NVIC;
use painleve_image::board::StartFault;
use painleve_image::watchdogs::IndependentWatchdog;

use crate::flash::{ERRORS, KEYS, PATIENCE};
use crate::watchdogs::Independent;
use crate::{comes, pac};

/// Keys that open the option bytes (RM0440, chapter FLASH: "Option bytes programming").
const OPTION_KEYS: [u32; 2] = [0x0819_2a3b, 0x4c5d_6e7f];

/// Starts monitoring the supply: below 2.9 V the interrupt PVD_PVM is raised; below 2.8 V the chip is held in
/// reset. The clock of the power control must be on. Feeds the watchdog meanwhile.
///
/// # Errors
/// [`StartFault::Supply`] if it is below 2.9 V already; [`StartFault::OptionBytes`].
pub fn watch(
    power: &pac::PWR,
    lines: &pac::EXTI,
    flash: &pac::FLASH,
    interrupts: &mut NVIC,
    watchdog: &Independent,
) -> Result<(), StartFault> {
    const BELOW_2_9_V: u8 = 6;
    lines.rtsr1().modify(|_, w| w.rt16().set_bit());
    lines.imr1().modify(|_, w| w.im16().set_bit());
    // The lines already wait for the edge of a supply that falls meanwhile.
    // SAFETY: PWR_CR2: a threshold.
    power
        .cr2()
        .modify(|_, w| unsafe { w.pvdls().bits(BELOW_2_9_V) }.pvde().set_bit());
    // SAFETY: the handler takes the torque off and shares nothing; its priority is the highest, which
    // no lock of a task's resource masks.
    unsafe {
        interrupts.set_priority(pac::Interrupt::PVD_PVM, 0);
        NVIC::unmask(pac::Interrupt::PVD_PVM);
    }
    if power.sr2().read().pvdo().bit_is_set() {
        return Err(StartFault::Supply);
    }
    raise_brown_out_level(flash, watchdog)
}

/// Stops the pull-downs of USB's dead-battery detection, which are on PB4 and PB6 after a reset (PWR_CR3).
pub fn stop_dead_battery_detection(power: &pac::PWR) {
    power.cr3().modify(|_, w| w.ucpd1_dbdis().set_bit());
}

/// Programs the brown-out level once in a chip's life: it is stored in the option bytes, and takes effect when
/// power comes up; until then its register gives the last one. A reset while they are programmed would spoil them.
fn raise_brown_out_level(flash: &pac::FLASH, watchdog: &Independent) -> Result<(), StartFault> {
    const HIGHEST: u8 = 4;
    if flash.optr().read().bor_lev().bits() == HIGHEST {
        return Ok(());
    }
    let is_done = || {
        comes(PATIENCE, || {
            watchdog.feed();
            flash.sr().read().bsy().bit_is_clear()
        })
    };
    if !is_done() {
        return Err(StartFault::OptionBytes);
    }
    // SAFETY: writing one clears an error; the keys of the manual, in its order, with no programming in progress.
    unsafe {
        flash.sr().write(|w| w.bits(ERRORS));
        for key in KEYS {
            flash.keyr().write(|w| w.bits(key));
        }
        for key in OPTION_KEYS {
            flash.optkeyr().write(|w| w.bits(key));
        }
        flash.optr().modify(|_, w| w.bor_lev().bits(HIGHEST));
    }
    flash.cr().modify(|_, w| w.optstrt().set_bit());
    if !is_done() {
        return Err(StartFault::OptionBytes);
    }
    let errors = flash.sr().read().bits() & ERRORS;
    flash
        .cr()
        .modify(|_, w| w.optlock().set_bit().lock().set_bit());
    if errors == 0 {
        Ok(())
    } else {
        Err(StartFault::OptionBytes)
    }
}

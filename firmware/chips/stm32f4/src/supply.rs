//! Monitoring of the supply (RM0090, chapter PWR: "Power supply supervisor").

#![allow(unsafe_code)] // keys, interrupt priorities

use cortex_m::peripheral::NVIC;
use painleve_image::board::StartFault;
use painleve_image::watchdogs::IndependentWatchdog;
use stm32f4xx_hal::pac;

use crate::flash::{ERRORS, PATIENCE};
use crate::watchdogs::Independent;

/// Keys that open the option bytes (RM0090, section 3.6.2).
const OPTION_KEYS: [u32; 2] = [0x0819_2a3b, 0x4c5d_6e7f];

/// Starts monitoring the supply: below 2.9 V the interrupt PVD is raised, which is handled as a
/// crash; below 2.7 V the chip is held in reset. Feeds the watchdog meanwhile.
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
    const BELOW_2_9_V: u8 = 7;
    lines.rtsr().modify(|_, w| w.tr16().set_bit());
    lines.imr().modify(|_, w| w.mr16().set_bit());
    // The lines already wait for the edge of a supply that falls meanwhile.
    // SAFETY: PWR_CR: a threshold.
    power
        .cr()
        .modify(|_, w| unsafe { w.pls().bits(BELOW_2_9_V) }.pvde().set_bit());
    // SAFETY: the handler takes the torque off and shares nothing; its priority is the highest, which
    // no lock of a task's resource masks.
    unsafe {
        interrupts.set_priority(pac::Interrupt::PVD, 0);
        NVIC::unmask(pac::Interrupt::PVD);
    }
    if power.csr().read().pvdo().bit_is_set() {
        return Err(StartFault::Supply);
    }
    raise_brown_out_level(flash, watchdog)
}

/// Programs the brown-out level once in a chip's life: it is stored in the option bytes, whose sector is erased
/// before. A reset in the meantime would spoil them, among them the protection against reading.
fn raise_brown_out_level(flash: &pac::FLASH, watchdog: &Independent) -> Result<(), StartFault> {
    const HIGHEST: u8 = 0;
    let is_highest = || flash.optcr().read().bor_lev().bits() == HIGHEST;
    if is_highest() {
        return Ok(());
    }
    let is_done = || {
        (0..PATIENCE).any(|_| {
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
        for key in OPTION_KEYS {
            flash.optkeyr().write(|w| w.bits(key));
        }
        flash.optcr().modify(|_, w| w.bor_lev().bits(HIGHEST));
        flash.optcr().modify(|_, w| w.optstrt().set_bit());
    }
    if !is_done() {
        return Err(StartFault::OptionBytes);
    }
    let errors = flash.sr().read().bits() & ERRORS;
    flash.optcr().modify(|_, w| w.optlock().set_bit());
    if errors == 0 && is_highest() {
        Ok(())
    } else {
        Err(StartFault::OptionBytes)
    }
}

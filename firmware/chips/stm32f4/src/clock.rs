//! Reasons for a reset, monitoring of the crystal (RM0090, chapter RCC), and sleep.

#![allow(unsafe_code)] // registers that the start does not own

use painleve_shared::black_box::ResetCause;
use stm32f4xx_hal::pac;

/// Returns the reason for the present start of the processor, and clears it for the next.
pub fn reset_cause() -> ResetCause {
    // SAFETY: flags that nothing else uses.
    let status = unsafe { (*pac::RCC::ptr()).csr() };
    let flags = status.read();
    let cause = if flags.porrstf().bit_is_set() || flags.borrstf().bit_is_set() {
        ResetCause::Power
    } else if flags.wdgrstf().bit_is_set() || flags.wwdgrstf().bit_is_set() {
        ResetCause::Watchdog
    } else if flags.sftrstf().bit_is_set() {
        ResetCause::Software
    } else if flags.padrstf().bit_is_set() {
        ResetCause::Pin
    } else {
        ResetCause::Unknown
    };
    status.modify(|_, w| w.rmvf().set_bit());
    cause
}

/// Starts monitoring the crystal: if it stops, the non-maskable interrupt is raised at once.
pub fn watch_crystal(rcc: &pac::rcc::RegisterBlock) {
    rcc.cr().modify(|_, w| w.csson().set_bit());
}

/// Sleeps until an interrupt, in which the processor's own clock runs on (DBGMCU_CR, DBG_SLEEP): without it the cycle counter
/// would stand still. A debugger that leaves may have stopped it, so that every sleep starts it.
pub fn sleep() {
    // SAFETY: a bit that no other code changes.
    let control = unsafe { (*pac::DBGMCU::ptr()).cr() };
    control.modify(|_, w| w.dbg_sleep().set_bit());
    cortex_m::asm::wfi();
}

//! The processor's clock: 170 MHz from a crystal (RM0440, chapters RCC and PWR: "Dynamic voltage scaling").

#![allow(unsafe_code)] // fields without named values

use painleve_shared::black_box::ResetCause;

use crate::{PATIENCE, comes, pac};

/// The clock of processor, buses and timers, Hz.
pub const CORE_HZ: u32 = 170_000_000;

/// Number of polls for a crystal that does not start: some 100 ms at the internal 16 MHz; a crystal needs 2 ms, but the data
/// sheet names no longest time.
const CRYSTAL_PATIENCE: u32 = 240_000;

/// Cycles of at least 1 µs at 85 MHz.
const BOOST_CYCLES: u32 = 100;

/// Wait states of the flash at 170 MHz in range 1 boost mode (RM0440, chapter FLASH: "Read access latency").
const FLASH_WAIT_STATES: u8 = 4;

/// A clock did not settle in time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unsettled;

fn settled(it: bool) -> Result<(), Unsettled> {
    if it { Ok(()) } else { Err(Unsettled) }
}

/// Runs the processor at [`CORE_HZ`] from a crystal of `crystal_mhz`, a multiple of 4. Every wait is bounded; on
/// an error the processor stays on its internal oscillator. From then on a crystal that stops raises the
/// non-maskable interrupt.
///
/// # Errors
/// If crystal or phase-locked loop do not settle.
pub fn start(
    rcc: &pac::RCC,
    power: &pac::PWR,
    flash: &pac::FLASH,
    crystal_mhz: u8,
) -> Result<(), Unsettled> {
    rcc.cr().modify(|_, w| w.hseon().set_bit());
    settled(comes(CRYSTAL_PATIENCE, || {
        rcc.cr().read().hserdy().bit_is_set()
    }))?;

    // 4 MHz · 85 / 2. The output divider 0 is a half.
    // SAFETY: RCC_PLLCFGR: divisor less one, multiplier, source 3 for the crystal.
    rcc.pllcfgr().write(|w| unsafe {
        w.pllsrc().bits(3);
        w.pllm().bits((crystal_mhz / 4).wrapping_sub(1) & 15);
        w.plln().bits(85);
        w.pllr().bits(0).pllren().set_bit()
    });
    rcc.cr().modify(|_, w| w.pllon().set_bit());
    settled(comes(PATIENCE, || rcc.cr().read().pllrdy().bit_is_set()))?;

    // Above 150 MHz the regulator needs its boost mode; the bus clock is halved before the change and until 1 µs after it.
    // SAFETY: RCC_CFGR: 8 is a half.
    rcc.cfgr().modify(|_, w| unsafe { w.hpre().bits(8) });
    rcc.apb1enr1().modify(|_, w| w.pwren().set_bit());
    let _ = rcc.apb1enr1().read();
    power.cr5().modify(|_, w| w.r1mode().clear_bit());
    flash.acr().modify(|_, w| {
        // SAFETY: a number of wait states.
        unsafe { w.latency().bits(FLASH_WAIT_STATES) };
        w.prften().set_bit().icen().set_bit().dcen().set_bit()
    });
    settled(comes(PATIENCE, || {
        flash.acr().read().latency().bits() == FLASH_WAIT_STATES
    }))?;
    // SAFETY: 3 is the phase-locked loop.
    rcc.cfgr().modify(|_, w| unsafe { w.sw().bits(3) });
    settled(comes(PATIENCE, || rcc.cfgr().read().sws().bits() == 3))?;
    cortex_m::asm::delay(BOOST_CYCLES);
    // SAFETY: 0 is undivided.
    rcc.cfgr().modify(|_, w| unsafe { w.hpre().bits(0) });
    rcc.cr().modify(|_, w| w.csson().set_bit());
    Ok(())
}

/// Returns the reason for the present start of the processor, and clears it for the next.
pub fn reset_cause() -> ResetCause {
    // SAFETY: flags that nothing else uses.
    let status = unsafe { (*pac::RCC::ptr()).csr() };
    let flags = status.read();
    let cause = if flags.borrstf().bit_is_set() {
        ResetCause::Power
    } else if flags.iwdgrstf().bit_is_set() || flags.wwdgrstf().bit_is_set() {
        ResetCause::Watchdog
    } else if flags.sftrstf().bit_is_set() {
        ResetCause::Software
    } else if flags.pinrstf().bit_is_set() {
        ResetCause::Pin
    } else {
        ResetCause::Unknown
    };
    status.modify(|_, w| w.rmvf().set_bit());
    cause
}

/// Sleeps until an interrupt, in which the processor's own clock runs on (DBGMCU_CR, DBG_SLEEP): without it the cycle counter
/// would stand still. A debugger that leaves may have stopped it, so that every sleep starts it.
pub fn sleep() {
    // SAFETY: a bit that no other code changes.
    let control = unsafe { (*pac::DBGMCU::ptr()).cr() };
    control.modify(|_, w| w.dbg_sleep().set_bit());
    cortex_m::asm::wfi();
}

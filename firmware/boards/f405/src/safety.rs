//! Takes the torque off when the program cannot: the first instructions after a reset, processor faults,
//! clock and supply monitoring, and two watchdogs.
//!
//! PB0 high enables the torque stages. From a reset until the first instructions the pin floats, and a
//! pull-down resistor on the board holds it low.

#![allow(unsafe_code)] // registers, whatever the program was doing

use painleve_drivers::stages::NO_TORQUE;
use painleve_image::board::StartFault;
use painleve_image::watchdogs::{IndependentLimit, IndependentWatchdog, WindowWatchdog};
use painleve_shared::black_box::ResetCause;
use stm32f4xx_hal::pac;

use crate::flash::{ERRORS, PATIENCE};

painleve_image::crash_handlers!(crate::F405);

/// Keys that open the option bytes (RM0090, section 3.6.2).
const OPTION_KEYS: [u32; 2] = [0x0819_2a3b, 0x4c5d_6e7f];

// The first instructions after a reset, in assembly because memory is not initialised yet: enable the clock
// of port B, set PB0 low, then make it an output. Then `program_memory` copies the program.
core::arch::global_asm!(
    ".section .Reset, \"ax\", %progbits",
    ".global __pre_init",
    ".type __pre_init, %function",
    ".thumb_func",
    "__pre_init:",
    "ldr r0, ={rcc_ahb1enr}",
    "ldr r1, [r0]",
    "orr r1, r1, #2",
    "str r1, [r0]",
    "ldr r1, [r0]",
    "ldr r0, ={gpiob}",
    "mov r1, #0x10000",
    "str r1, [r0, #0x18]",
    "ldr r1, [r0]",
    "bic r1, r1, #3",
    "orr r1, r1, #1",
    "str r1, [r0]",
    "b __copy_program",
    ".ltorg",
    ".size __pre_init, . - __pre_init",
    rcc_ahb1enr = const 0x4002_3830_u32,
    gpiob = const 0x4002_0400_u32,
);

/// Takes the torque off from any point of the program: stages disabled, and zero torque from the converter.
pub fn take_torque_off() {
    // SAFETY: these registers exist whatever the program was doing. What is read, changed and stored here has its value
    // from the first instructions on, so code that was interrupted between its own read and store does not undo it.
    unsafe {
        let rcc = &*pac::RCC::ptr();
        rcc.ahb1enr().modify(|_, w| w.gpioben().set_bit());
        let port = &*pac::GPIOB::ptr();
        port.bsrr().write(|w| w.br0().set_bit());
        port.moder().modify(|_, w| w.moder0().output());
        if rcc.apb1enr().read().dacen().bit_is_set() {
            let code = u32::from(NO_TORQUE);
            (*pac::DAC::ptr())
                .dhr12rd()
                .write(|w| w.bits(code << 16 | code));
        }
    }
}

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

/// Starts monitoring the supply: below 2.9 V the interrupt PVD is raised, which is handled as a
/// crash; below 2.7 V the chip is held in reset. Feeds the watchdog meanwhile.
///
/// # Errors
/// [`StartFault::OptionBytes`].
pub fn watch_supply(
    power: &pac::PWR,
    lines: &pac::EXTI,
    flash: &pac::FLASH,
    interrupts: &mut cortex_m::peripheral::NVIC,
    watchdog: &Independent,
) -> Result<(), StartFault> {
    power
        .cr()
        .modify(|_, w| unsafe { w.pls().bits(7) }.pvde().set_bit());
    lines.rtsr().modify(|_, w| w.tr16().set_bit());
    lines.imr().modify(|_, w| w.mr16().set_bit());
    // SAFETY: the handler takes the torque off and shares nothing; its priority is the highest, which
    // no critical section masks.
    unsafe {
        interrupts.set_priority(pac::Interrupt::PVD, 0);
        cortex_m::peripheral::NVIC::unmask(pac::Interrupt::PVD);
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

/// The independent watchdog. Its oscillator has 17 to 47 kHz: it resets the chip after 2 to 6 periods.
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
            self.0.rlr().write(|w| w.bits(limit.reload.into()));
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

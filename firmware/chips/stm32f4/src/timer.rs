//! TIM2, the control timer: the same registers on the chip and under QEMU.

#![allow(unsafe_code)] // the reset of a peripheral

use cortex_m::peripheral::NVIC;
use stm32f4xx_hal::pac::{Interrupt, TIM2};
use stm32f4xx_hal::rcc::Reset;

/// Starts the timer's interrupt with a period of `counts` of its clock.
pub fn start(timer: &TIM2, counts: f32) {
    // The reset sets the count back, which may be beyond `counts`. An update event, UG, would raise the interrupt; under
    // QEMU 7.2, whose timer reports the time since its start and has no reset, the amount set back would be
    // added to every period. The prescaler stays 0, its value after a reset: writing it makes that QEMU
    // add every 2^32 counts passed since the board's start, 4.3 s, to each period.
    // SAFETY: the timer is borrowed, and its users do not change the reset's register meanwhile.
    unsafe { TIM2::reset_unchecked() };
    timer.cr1().write(|w| w.cen().clear_bit());
    timer.arr().write(|w| w.arr().set(counts as u32 - 1));
    acknowledge(timer);
    // One of the former period may wait since the interrupt was masked.
    NVIC::unpend(Interrupt::TIM2);
    timer.dier().write(|w| w.uie().set_bit());
    timer.cr1().write(|w| w.cen().set_bit());
}

/// Clears the interrupt.
pub fn acknowledge(timer: &TIM2) {
    timer.sr().modify(|_, w| w.uif().clear_bit());
}

/// Returns whether the interrupt has occurred again since it was cleared.
pub fn is_due(timer: &TIM2) -> bool {
    timer.sr().read().uif().bit_is_set()
}

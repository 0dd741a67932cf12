//! TIM2, the control timer.

use cortex_m::peripheral::NVIC;

use crate::pac::{Interrupt, TIM2};

/// Restarts the timer with an interrupt after every `counts` of its clock; the first comes a period from now.
pub fn restart(timer: &TIM2, counts: f32) {
    timer.cr1().write(|w| w.cen().clear_bit());
    timer.dier().write(|w| w.uie().clear_bit());
    timer.arr().write(|w| w.arr().set(counts as u32 - 1));
    // Setting the count back raises the interrupt's flag, too.
    timer.egr().write(|w| w.ug().set_bit());
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

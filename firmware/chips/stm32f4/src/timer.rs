//! TIM2, the control timer: the same registers on the chip and under QEMU.

use stm32f4xx_hal::pac::TIM2;

/// Starts the timer's interrupt with a period of `counts` of its clock. If the present count is
/// beyond `counts`, first reset it with [`set_back`].
pub fn start(timer: &TIM2, counts: f32) {
    // The prescaler stays 0, its value after a reset: writing it makes QEMU 7.2 add every 2^32 counts
    // passed since the board's start, 4.3 s, to each period.
    timer.cr1().write(|w| w.cen().clear_bit());
    timer.arr().write(|w| w.arr().set(counts as u32 - 1));
    acknowledge(timer);
    timer.dier().write(|w| w.uie().set_bit());
    timer.cr1().write(|w| w.cen().set_bit());
}

/// Sets the count to zero and stops the interrupt until [`start`]. Do not call it under QEMU 7.2: its
/// timer has no count of its own but reports the time since its start, and adds the amount set back
/// to every period.
pub fn set_back(timer: &TIM2) {
    // Setting the count back raises the interrupt, too: the first tick would come at once.
    timer.dier().write(|w| w.uie().clear_bit());
    timer.egr().write(|w| w.ug().set_bit());
}

/// Clears the interrupt.
pub fn acknowledge(timer: &TIM2) {
    timer.sr().modify(|_, w| w.uif().clear_bit());
}

/// Returns whether the interrupt has occurred again since it was cleared.
pub fn is_due(timer: &TIM2) -> bool {
    timer.sr().read().uif().bit_is_set()
}

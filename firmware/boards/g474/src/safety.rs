//! Takes the torque off when the program cannot: the first instructions after a reset, and crashes.
//!
//! PB0 high enables the torque stages. From a reset until the first instructions the pin floats, and a
//! pull-down resistor on the board holds it low.

#![allow(unsafe_code)] // registers, whatever the program was doing

use painleve_drivers::stages::NO_TORQUE;
use painleve_stm32g4::pac;

painleve_image::crash_handlers!(crate::G474);

// The first instructions after a reset, in assembly because memory is not initialised yet: enable the clock
// of port B, set PB0 low, then make it an output.
core::arch::global_asm!(
    ".section .Reset, \"ax\", %progbits",
    ".global __pre_init",
    ".type __pre_init, %function",
    ".thumb_func",
    "__pre_init:",
    "ldr r0, ={rcc_ahb2enr}",
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
    "bx lr",
    ".ltorg",
    ".size __pre_init, . - __pre_init",
    rcc_ahb2enr = const 0x4002_104c_u32,
    gpiob = const 0x4800_0400_u32,
);

/// Takes the torque off from any point of the program: stages disabled, and zero torque from the converter.
pub fn take_torque_off() {
    // SAFETY: these registers exist whatever the program was doing. What is read, changed and stored here has its value
    // from the first instructions on, so code that was interrupted between its own read and store does not undo it.
    unsafe {
        let rcc = &*pac::RCC::ptr();
        rcc.ahb2enr().modify(|_, w| w.gpioben().set_bit());
        let port = &*pac::GPIOB::ptr();
        port.bsrr().write(|w| w.bits(1 << 16));
        port.moder().modify(|_, w| w.moder0().output());
        if rcc.ahb2enr().read().dac1en().bit_is_set() {
            let code = u32::from(NO_TORQUE);
            let converter = &*pac::DAC1::ptr();
            converter.dhr12rd().write(|w| w.bits(code << 16 | code));
        }
    }
}

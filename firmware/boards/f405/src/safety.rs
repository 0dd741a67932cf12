//! Takes the torque off when the program cannot: in the first instructions after a reset, and after faults.
//!
//! PB0 high enables the torque stages. From a reset until the first instructions the pin floats, and a
//! pull-down resistor on the board holds it low.

#![allow(unsafe_code)] // registers, whatever the program was doing

use painleve_drivers::stages::NO_TORQUE;
use stm32f4xx_hal::pac;

painleve_image::crash_handlers!(crate::F405);

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

//! QEMU's `netduinoplus2`, a board with an STM32F405, the chip of the flash target.
//!
//! - `pipes`: in lockstep with its host, deterministic to the instruction
//! - `serial`: with an independent clock, over the flash target's serial port

#![no_std]
#![cfg(target_os = "none")]

pub mod pipes;
pub mod serial;

pub use pipes::Qemu;
pub use serial::QemuSerial;
pub use stm32f4xx_hal::pac;

/// Declares the image for the board in lockstep, with these laws.
#[macro_export]
macro_rules! image {
    ($laws:ty) => {
        ::painleve_image::tasks! {
            board = $crate::Qemu, laws = $laws, device = $crate::pac,
            control = TIM2, update = TIM3, serial = USART1, link = SPI3
        }
    };
}

/// Declares the image for the board over its serial port, with these laws.
#[macro_export]
macro_rules! serial_image {
    ($laws:ty) => {
        ::painleve_image::tasks! {
            board = $crate::QemuSerial, laws = $laws, device = $crate::pac,
            control = TIM2, update = TIM3, serial = USART1, link = SPI3
        }
    };
}

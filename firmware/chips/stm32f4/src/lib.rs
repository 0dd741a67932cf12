//! Code shared by boards with an STM32F4: the control timer, the serial port and SPI words.

#![no_std]
#![cfg(target_os = "none")]

pub mod spi;
pub mod timer;
pub mod uart;

//! Code shared by boards with an STM32F4: the control timer and SPI words.

#![no_std]
#![cfg(target_os = "none")]

pub mod spi;
pub mod timer;

//! What boards with an STM32F4 share: the control timer and the serial port.

#![no_std]
#![cfg(target_os = "none")]

pub mod timer;
pub mod uart;

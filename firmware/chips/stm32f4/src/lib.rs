//! Code shared by boards with an STM32F4: the control timer and the serial port.

#![no_std]
#![cfg(target_os = "none")]

pub mod timer;
pub mod uart;

//! Code shared by boards with an STM32F4: the control timer, the serial port and the sensors' buses.

#![no_std]
#![cfg(target_os = "none")]

pub mod sensor_bus;
pub mod timer;
pub mod uart;

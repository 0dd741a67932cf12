//! Code for boards with an STM32F4 (RM0090): the control timer, SPI words, the serial port, flash, supply and watchdogs.

#![no_std]
#![cfg(target_os = "none")]

pub mod clock;
pub mod flash;
pub mod spi;
pub mod supply;
pub mod timer;
pub mod uart_dma;
pub mod watchdogs;

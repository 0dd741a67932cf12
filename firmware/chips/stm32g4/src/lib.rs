//! Code for boards with an STM32G4 (RM0440): clocks, pins, the control timer, the serial port, SPI, supply and
//! watchdogs.
//!
//! It uses the registers of `stm32g4` instead of `stm32g4xx-hal` 0.1.0, whose start of the clocks waits without
//! a limit and panics, and which resets a port before it configures its pins. `stm32f4xx-hal`, which the other board
//! uses, knows no STM32G4.

#![no_std]
#![cfg(target_os = "none")]

pub mod clock;
pub mod flash;
pub mod pins;
pub mod spi;
pub mod supply;
pub mod timer;
pub mod usart2;
pub mod watchdogs;

pub use stm32g4::stm32g474 as pac;

/// Number of polls of a flag that should change within microseconds.
const PATIENCE: u32 = 100_000;

/// Returns whether a flag appears in bounded time.
fn comes(patience: u32, flag: impl Fn() -> bool) -> bool {
    (0..patience).any(|_| flag())
}

//! The image for the STM32F405.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod app;
#[cfg(target_os = "none")]
mod board;
#[cfg(target_os = "none")]
mod configure;
#[cfg(target_os = "none")]
#[path = "board/f405.rs"]
mod f405;
#[cfg(target_os = "none")]
#[path = "board/safety.rs"]
mod safety;
#[cfg(target_os = "none")]
mod stack;
#[cfg(target_os = "none")]
#[path = "board/uart_dma.rs"]
mod uart_dma;
#[cfg(target_os = "none")]
mod watch;

/// The board of this image.
#[cfg(target_os = "none")]
use f405::F405 as Hardware;

/// A PC, where `--all-features` comes by, has nothing to run.
#[cfg(not(target_os = "none"))]
fn main() {}

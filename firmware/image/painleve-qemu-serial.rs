//! The image for QEMU's `netduinoplus2` with its serial port as the link.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod app;
#[cfg(target_os = "none")]
mod board;
#[cfg(target_os = "none")]
mod configure;
#[cfg(target_os = "none")]
#[path = "board/qemu.rs"]
mod qemu;
#[cfg(target_os = "none")]
#[path = "board/qemu_serial.rs"]
mod qemu_serial;
#[cfg(target_os = "none")]
mod stack;
#[cfg(target_os = "none")]
#[path = "board/uart.rs"]
mod uart;
#[cfg(target_os = "none")]
mod watch;

/// The board of this image.
#[cfg(target_os = "none")]
use qemu_serial::QemuSerial as Hardware;

/// A PC, where `--all-features` comes by, has nothing to run.
#[cfg(not(target_os = "none"))]
fn main() {}

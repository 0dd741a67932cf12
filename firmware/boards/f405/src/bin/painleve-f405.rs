//! The image for the STM32F405.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
painleve_f405_board::image!(painleve_firmware::law::LawSettings);

/// Does nothing on a PC.
#[cfg(not(target_os = "none"))]
fn main() {}

//! The image for the STM32F405, on a board and in the emulator, with our laws.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
painleve_f405_board::image!(own_law::OurLaws);

/// Does nothing on a PC.
#[cfg(not(target_os = "none"))]
fn main() {}

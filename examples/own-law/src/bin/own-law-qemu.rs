//! The image for the emulated board with our laws.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
painleve_qemu_board::image!(own_law::OurLaws);

/// Does nothing on a PC.
#[cfg(not(target_os = "none"))]
fn main() {}

//! The image for the NUCLEO-G474RE.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
painleve_g474_board::image!(painleve_firmware::law::LawSettings);

/// Does nothing on a PC.
#[cfg(not(target_os = "none"))]
fn main() {}

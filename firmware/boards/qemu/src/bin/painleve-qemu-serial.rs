//! The image for QEMU's `netduinoplus2` with its serial port as the link.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
painleve_qemu_board::serial_image!(painleve_firmware::law::LawSettings);

/// Does nothing on a PC.
#[cfg(not(target_os = "none"))]
fn main() {}

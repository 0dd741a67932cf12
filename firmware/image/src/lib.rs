//! What the images of all boards share. It names no chip: a board crate brings its own peripherals,
//! and [`tasks!`] puts the two together with a set of laws:
//!
//! ```text
//! #[cfg(target_os = "none")]
//! painleve_qemu_board::image!(MyLaws);
//! ```

#![no_std]
#![cfg(target_os = "none")]

pub mod board;
pub mod stack;
pub mod tasks;
mod watch;

#[doc(hidden)]
pub use {cortex_m, heapless, painleve_firmware, painleve_shared, rtic};

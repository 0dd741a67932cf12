//! Code shared by the images of all boards. It names no chip: a board crate provides its own
//! peripherals, and `tasks!` combines them with this code and a set of laws:
//!
//! ```text
//! #[cfg(target_os = "none")]
//! painleve_f405_board::image!(MyLaws);
//! ```

#![no_std]
#![cfg(target_os = "none")]

pub mod arm_drive;
pub mod black_box;
pub mod board;
pub mod crash;
pub mod dma_serial;
pub mod flash;
pub mod link;
pub mod memory;
pub mod port;
pub mod probe;
pub mod protection;
pub mod sensor_bus;
pub mod stack;
pub mod tasks;
mod watch;
pub mod watchdogs;

#[doc(hidden)]
pub use {cortex_m, heapless, painleve_firmware, painleve_shared, rtic};

//! Runs the image that is flashed, unchanged and instruction by instruction, on a modelled board.
//!
//! - [`unicorn`]: executes instructions
//! - [`machine`]: exceptions, sleep, resets, time
//! - [`stm32f4`], [`stm32g4`]: the microcontrollers' peripherals, [`stm32`] what they have in common; the
//!   sensors on their buses are in [`painleve_parts`]
//! - [`board`]: the board's wiring, the host's end of its serial line, the arm's torques
//! - [`mod@bench`]: the board with the simulated arm on its sensors and stages
//! - [`harm`]: what the arm does between a failure and the stop of the drive
//!
//! Time is counted in instructions: each takes [`machine::CYCLES_PER_INSTRUCTION`] of the clock
//! that the image has configured. It does not measure the time on silicon.

pub mod bench;
pub mod board;
pub mod harm;
pub mod machine;
pub mod protection;
pub mod stm32;
pub mod stm32f4;
pub mod stm32g4;
pub mod system_control;
pub mod unicorn;

pub use painleve_parts::Picoseconds;

/// One millisecond.
pub const MILLISECOND: Picoseconds = 1_000_000_000;

/// One microsecond.
pub const MICROSECOND: Picoseconds = 1_000_000;

/// One second.
pub const SECOND: Picoseconds = 1_000_000_000_000;

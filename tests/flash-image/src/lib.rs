//! Runs the image that is flashed, unchanged and instruction by instruction, on a modelled board.
//!
//! - [`unicorn`]: executes instructions
//! - [`machine`]: exceptions, sleep, resets, time; [`protection`]: what memory may be used for
//! - [`stm32f4`], [`stm32g4`]: the microcontrollers' peripherals, [`stm32`] what they have in common; the
//!   sensors on their buses are in [`painleve_parts`]
//! - [`board`]: the board's wiring, the host's end of its serial line, the arm's torques
//! - [`mod@bench`]: the board with the simulated arm on its sensors and stages
//! - [`bare`]: a bench without an arm, with loop-back wires
//! - [`harm`]: what the arm does between a failure and the stop of the drive
//!
//! The models are not kinder than the manuals:
//!
//! | | open or slow in the manuals | here |
//! |---|---|---|
//! | window watchdog | phase of its prescaler, which runs freely | any, drawn by tests |
//! | | the window itself | not modelled: the image opens it wholly |
//! | independent watchdog | frequency of its oscillator | lowest, usual and highest in tests |
//! | | time until a limit takes effect | five cycles, or a drawn phase less; the next limit must wait for it |
//! | option bytes | time to program them | 800 ms and 50 ms; a reset meanwhile ends the test |
//! | | what their register gives afterwards | STM32G474: the old ones until power comes up |
//! | flash | time to erase a sector | 1 ms, except in tests that ask for seconds |
//! | | access while it is busy | ends the test |
//! | memory protection | all regions | as the image sets them; not inside the slots for configurations |
//! | exceptions | a frame that cannot be stored | a hard fault |
//! | crystal | time to start | 2 ms, or never |
//! | serial port | overrun | modelled; noise and framing errors are not |
//! | SPI | overrun | modelled on the STM32G474 |
//! | DMA | errors | not modelled |
//! | supply | slow ramps and thresholds' tolerance | not modelled |
//! | all registers | reserved bits, errata, wait states, contention on the bus | not modelled |
//!
//! Time is counted in instructions: each takes [`machine::CYCLES_PER_INSTRUCTION`] of the clock
//! that the image has configured. It does not measure the time on silicon.

pub mod bare;
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

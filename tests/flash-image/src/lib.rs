//! Runs the image that is flashed, unchanged and instruction by instruction, on a modelled board.
//!
//! - [`board`]: the board's wiring, the host's end of its serial line, the arm's torques
//! - [`mod@bench`]: the board with the simulated arm on its sensors and stages
//! - [`bare`]: a bench without an arm, with loop-back wires
//! - [`harm`]: what the arm does between a failure and the stop of the drive
//!
//! [`painleve_chips`] models the chips and says where the models differ from them.

pub mod bare;
pub mod bench;
pub mod board;
pub mod harm;

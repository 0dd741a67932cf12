//! A bound on the cycles of the image's control interrupt, from its machine code.
//!
//! The image is decoded ([`instruction`]) into a control-flow graph for each function ([`graph`]);
//! every block costs what the cycle model says at most ([`cycles`], [`cost`]); loops have declared
//! limits ([`loops`]); and a linear programme finds the most expensive way through ([`worst`]).
//! [`report`] prints it with source lines.
//!
//! The bound holds for every configuration and every frame, because it asks for neither.

pub mod cost;
pub mod cycles;
pub mod graph;
pub mod image;
pub mod instruction;
pub mod loops;
pub mod report;
pub mod trace;
pub mod worst;

use std::path::PathBuf;

/// Why there is no bound.
#[derive(Debug, thiserror::Error)]
pub enum BoundError {
    /// The image cannot be read.
    #[error("{path}: {reason}")]
    Image {
        /// Which.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// The decoder fails.
    #[error("decoder: {0}")]
    Decoder(capstone::Error),
    /// An instruction whose cost or destination is not known.
    #[error("at 0x{address:08x}: nothing is known of the cost of \"{text}\"")]
    UnknownInstruction {
        /// Where.
        address: u32,
        /// Which.
        text: String,
    },
    /// A function calls itself.
    #[error("the function at 0x{address:08x} calls itself")]
    Recursion {
        /// Which.
        address: u32,
    },
    /// A loop with several entries.
    #[error("the loop at 0x{address:08x} has several entries")]
    Irreducible {
        /// Where.
        address: u32,
    },
    /// A loop that nothing is declared of.
    #[error("the loop at 0x{address:08x}, in {place}, has no declared limit")]
    Unbounded {
        /// Where.
        address: u32,
        /// In which functions' source.
        place: String,
    },
    /// The interrupt has no way out.
    #[error("the function at 0x{address:08x} never returns")]
    NeverReturns {
        /// Which.
        address: u32,
    },
    /// The linear programme has no solution.
    #[error("linear programme: {0}")]
    Programme(String),
}

//! Upper bounds on the cycles of the image's control interrupt and of the update after it, derived from its machine
//! code.
//!
//! The image is decoded ([`instruction`]) into a control-flow graph for each function ([`graph`]).
//! The cycle model bounds the cost of every block ([`cycles`], [`values`], [`cost`]), loops have declared
//! limits ([`loops`]), and a linear programme finds the most expensive path ([`worst`]). [`report`]
//! prints it with source lines. [`profile`] shows where executed ticks spend their instructions.
//!
//! The bounds hold for every configuration and every frame, because they depend on neither.

pub mod connected;
pub mod cost;
pub mod cycles;
pub mod effect;
pub mod graph;
pub mod image;
pub mod instruction;
pub mod loops;
pub mod profile;
pub mod report;
pub mod sections;
pub mod trace;
pub mod values;
pub mod worst;

use std::path::{Path, PathBuf};

/// Returns the path of the F405's image in this workspace.
pub fn built_image() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../target/thumbv7em-none-eabihf/firmware/painleve-f405")
}

/// Why a bound cannot be found.
#[derive(Debug, thiserror::Error)]
pub enum BoundError {
    /// The image cannot be read.
    #[error("{path}: {source}")]
    Image {
        /// Path of the image.
        path: PathBuf,
        /// The reason.
        source: ImageError,
    },
    /// The decoder failed.
    #[error("decoder: {0}")]
    Decoder(capstone::Error),
    /// The cost or destination of an instruction is unknown.
    #[error("at 0x{address:08x}: the cost of \"{text}\" is unknown")]
    UnknownInstruction {
        /// Address.
        address: u32,
        /// Disassembly.
        text: String,
    },
    /// No handler calls a function.
    #[error("no handler calls the function at 0x{address:08x}")]
    NotFollowed {
        /// Address.
        address: u32,
    },
    /// A function returns with interrupts masked.
    #[error("the section at 0x{address:08x} does not end in its function")]
    LeftMasked {
        /// Address.
        address: u32,
    },
    /// A function is recursive.
    #[error("the function at 0x{address:08x} calls itself, or one that calls it")]
    Recursion {
        /// Address.
        address: u32,
    },
    /// A section masks interrupts that are masked already: what restores them does not end it.
    #[error("the section at 0x{address:08x} masks the interrupts twice")]
    MaskedTwice {
        /// Address.
        address: u32,
    },
    /// A loop has several entries.
    #[error("the loop at 0x{address:08x} has several entries")]
    Irreducible {
        /// Address.
        address: u32,
    },
    /// A loop has no declared limit.
    #[error("the loop at 0x{address:08x}, in {place}, has no declared limit")]
    Unbounded {
        /// Address.
        address: u32,
        /// Source functions of the loop.
        place: String,
    },
    /// A call clears more memory than declared, or an unknown amount.
    #[error("the call in the block at 0x{address:08x} may clear more than the declared bytes")]
    ClearsTooMuch {
        /// Address.
        address: u32,
    },
    /// The interrupt never returns.
    #[error("the function at 0x{address:08x} never returns")]
    NeverReturns {
        /// Address.
        address: u32,
    },
    /// The linear programme has no solution.
    #[error("linear programme: {0}")]
    Programme(#[from] microlp::Error),
    /// The solver of the linear programme ended without an optimum.
    #[error("linear programme: no optimum")]
    NoOptimum,
}

/// Why an image cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// The file cannot be read.
    #[error(transparent)]
    Read(#[from] std::io::Error),
    /// The file is not an ELF file.
    #[error(transparent)]
    Elf(#[from] object::Error),
    /// The source locations cannot be read.
    #[error("source locations: {0}")]
    Lines(Box<dyn std::error::Error>),
    /// The program begins where that of no known chip does.
    #[error(
        "this is neither a program of the STM32F405, below 0x1c000, nor one of the STM32G474, from 0x08000000 on"
    )]
    UnknownChip,
    /// The image has no function of its own whose name contains this, or several.
    #[error("there is not exactly one function {0} with code of its own")]
    NotOneFunction(String),
    /// The image has no function of this name.
    #[error("there is no function {0}")]
    NoFunction(String),
}

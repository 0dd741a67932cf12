//! Charts as SVG, laid out as in the paper.
//!
//! - [`chart`]: stacked panels of curves, points and regions over one axis
//! - [`style`]: what all figures share: colours, fonts, ticks
//! - [`decimate`]: runs of any length in bounded memory, extremes kept
//! - [`axis`]: ranges that outliers cannot spoil, and their labels

pub mod axis;
pub mod chart;
pub mod decimate;
pub mod style;

pub use chart::{Chart, Mark, Panel};

/// Why a figure could not be made.
#[derive(Debug, thiserror::Error)]
pub enum PlotError {
    /// The drawing library refused.
    #[error("cannot draw the figure: {0}; please report this")]
    Draw(String),
    /// The figure's file cannot be written.
    #[error(transparent)]
    File(#[from] painleve_system::atomic_file::AtomicFileError),
}

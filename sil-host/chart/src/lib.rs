//! Charts as SVG, laid out as in the paper.
//!
//! - [`chart`]: stacked panels of curves, points and regions over one shared axis
//! - [`style`]: colours, fonts and ticks common to all figures
//! - [`decimate`]: runs of any length in bounded memory, with their extremes
//! - [`axis`]: ranges that are robust to outliers, and their labels

pub mod axis;
pub mod chart;
pub mod decimate;
pub mod style;

pub use chart::{Chart, Mark, Panel};

/// Why a figure could not be drawn or written.
#[derive(Debug, thiserror::Error)]
pub enum PlotError {
    /// The drawing library failed.
    #[error("cannot draw the figure: {0}; please report this")]
    Draw(String),
    /// The figure's file cannot be written.
    #[error(transparent)]
    File(#[from] painleve_system::atomic_file::AtomicFileError),
}

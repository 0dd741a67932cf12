//! Figures as SVG, laid out as in the paper.
//!
//! - [`run`]: one run over time, stacked panels on one time axis
//! - [`chart`]: the figures of studies: curves, points and regions over one axis
//! - [`timing`]: what ticks cost
//! - [`decimate`]: runs of any length in bounded memory, extremes kept
//! - [`axis`]: ranges that outliers cannot spoil, and their labels

pub mod axis;
pub mod chart;
pub mod decimate;
pub mod run;
pub(crate) mod style;
pub mod timing;

pub use chart::Chart;
pub use run::RunPlot;

/// Why a figure could not be made.
#[derive(Debug, thiserror::Error)]
pub enum PlotError {
    /// The drawing library refused.
    #[error("cannot draw the figure: {0}; please report this")]
    Draw(String),
    /// The figure's file cannot be written.
    #[error(transparent)]
    File(#[from] crate::atomic_file::AtomicFileError),
}

//! Records of a run.
//!
//! - [`mcap`]: every tick as a log file for Foxglove, PlotJuggler and scripts
//! - [`plot`]: the run over time as a figure
//! - [`report`]: the results of the run as JSON and as a table

pub mod mcap;
pub mod plot;
pub mod report;

pub use plot::RunPlot;

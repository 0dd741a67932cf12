//! What a run leaves behind.
//!
//! - [`mcap`]: every tick as a log file for Foxglove, PlotJuggler and scripts
//! - [`plot`]: the run over time as a figure
//! - [`report`]: what the run came to, as JSON and as a table

pub mod mcap;
pub mod plot;
pub mod report;

pub use plot::RunPlot;

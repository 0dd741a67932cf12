//! Charts as SVG, laid out as in the paper.
//!
//! - [`chart`]: panels of curves, points and regions, stacked over one shared axis or side by side
//! - [`canvas`]: shapes and text as an SVG file, for light and dark screens
//! - [`markup`]: text inside XML and HTML
//! - [`style`]: colours, fonts and ticks common to all figures
//! - [`decimate`]: runs of any length in bounded memory, with their extremes
//! - [`axis`]: ranges that are robust to outliers, and their labels

pub mod axis;
pub mod canvas;
pub mod chart;
mod dark;
pub mod decimate;
pub mod markup;
pub mod style;

pub use chart::{Chart, Mark, Panel};

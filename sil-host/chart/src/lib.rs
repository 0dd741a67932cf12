//! Charts, laid out as in the paper.
//!
//! - [`chart`]: panels of curves, points and regions, stacked over one shared axis or side by side
//! - [`canvas`]: shapes and text as an SVG file, for light and dark screens
//! - [`markup`]: text inside XML and HTML
//! - [`style`]: colours, fonts and ticks common to all figures
//! - [`decimate`]: runs of any length in bounded memory, with their extremes
//! - [`axis`]: ranges that are robust to outliers, and their labels
//! - [`picture`]: figures as SVG, PNG or PDF
//!
//! ```
//! use painleve_chart::style::BLUE_INK;
//! use painleve_chart::{Chart, Mark, Panel};
//!
//! let fall = (0..=10).map(|n| 0.1 * f64::from(n)).map(|t| (t, 5.0 - 4.905 * t * t));
//! let chart = Chart {
//!     title: "A stone falls".into(),
//!     x_title: "Time (s)".into(),
//!     panels: vec![Panel {
//!         title: "Height (m)".into(),
//!         marks: vec![Mark::line("stone", BLUE_INK, fall.collect())],
//!         ..Panel::default()
//!     }],
//!     ..Chart::default()
//! };
//! assert!(chart.svg().starts_with("<svg"));
//! ```

pub mod axis;
pub mod canvas;
pub mod chart;
mod dark;
pub mod decimate;
pub mod markup;
pub mod picture;
pub mod style;

pub use chart::{Chart, Mark, Panel};

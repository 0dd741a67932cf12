//! Figures of studies: stacked panels of curves, points and regions over one shared axis.

mod placed;

use std::ops::Range;

use plotters::style::RGBColor;
use plotters::style::text_anchor::HPos;

use super::PlotError;
use super::axis::label;
use super::style::{self, HEADING, SUBTITLE, TICK, TITLE, over_white, text, ticks};
use placed::{Placed, x_pixel};

const WIDTH: i32 = 2000;
const LEFT: i32 = 170;
const RIGHT: i32 = 50;
const TITLE_HEIGHT: i32 = 124;
const ROW: i32 = 50;
const GAP: i32 = 24;
const AXIS_HEIGHT: i32 = 110;
const X_TICKS: usize = 12;

/// A figure.
#[derive(Clone, Debug, Default)]
pub struct Chart {
    /// Title of the figure.
    pub title: String,
    /// Parameters common to all panels; about 110 characters.
    pub subtitle: String,
    /// Name and unit of the axis that all panels share.
    pub x_title: String,
    /// Ends of the shared axis; by default those of all points.
    pub x: Option<Range<f64>>,
    /// Panels from top to bottom.
    pub panels: Vec<Panel>,
}

/// A panel of a figure.
#[derive(Clone, Debug)]
pub struct Panel {
    /// Name and unit of the value axis.
    pub title: String,
    /// Note on how to read the panel.
    pub note: String,
    /// Ends of the value axis; by default those of all points.
    pub y: Option<Range<f64>>,
    /// Approximate number of value labels; zero for a strip without values.
    pub y_ticks: usize,
    /// Height in drawn units; a whole figure is 2000 wide.
    pub height: i32,
    /// Contents, from bottom to top.
    pub marks: Vec<Mark>,
}

impl Default for Panel {
    fn default() -> Self {
        Self {
            title: String::new(),
            note: String::new(),
            y: None,
            y_ticks: 6,
            height: 600,
            marks: Vec::new(),
        }
    }
}

/// An element of a panel; a named element appears in the legend.
#[derive(Clone, Debug)]
pub enum Mark {
    /// Points joined by straight lines; a NaN interrupts the line.
    Line {
        /// Name in the legend.
        name: String,
        /// Colour.
        colour: RGBColor,
        /// Width in drawn units.
        width: u32,
        /// Dashed instead of solid.
        dashed: bool,
        /// Points from first to last.
        points: Vec<(f64, f64)>,
    },
    /// Separate points.
    Dots {
        /// Name in the legend.
        name: String,
        /// Colour.
        colour: RGBColor,
        /// Side of the square in drawn units.
        size: i32,
        /// Points in any order.
        points: Vec<(f64, f64)>,
    },
    /// An interval of the axis, shaded over the panel's height.
    Span {
        /// Name in the legend.
        name: String,
        /// Colour.
        colour: RGBColor,
        /// Opacity, from 0 (clear) to 1 (solid).
        opacity: f64,
        /// Ends of the interval.
        x: Range<f64>,
    },
    /// A map of equal cells.
    Cells {
        /// Ends of the map along the shared axis.
        x: Range<f64>,
        /// Ends of the map along the value axis.
        y: Range<f64>,
        /// Number of cells from left to right.
        columns: usize,
        /// Names and colours of the palette.
        palette: Vec<(String, RGBColor)>,
        /// Palette index of each cell, row by row from the bottom, left to right;
        /// an index outside the palette leaves the cell clear.
        cells: Vec<u8>,
    },
    /// A text in the panel.
    Label {
        /// Position of its middle, or of its left end.
        at: (f64, f64),
        /// Whether `at` is the middle.
        centred: bool,
        /// The text.
        text: String,
    },
}

impl Mark {
    /// Creates a solid line.
    pub fn line(name: &str, colour: RGBColor, points: Vec<(f64, f64)>) -> Self {
        Self::Line {
            name: name.into(),
            colour,
            width: 3,
            dashed: false,
            points,
        }
    }

    /// Creates a dashed line.
    pub fn dashed(name: &str, colour: RGBColor, points: Vec<(f64, f64)>) -> Self {
        Self::Line {
            name: name.into(),
            colour,
            width: 3,
            dashed: true,
            points,
        }
    }

    fn points(&self) -> &[(f64, f64)] {
        match self {
            Self::Line { points, .. } | Self::Dots { points, .. } => points,
            _ => &[],
        }
    }

    /// Returns the entries for the legend.
    fn legend(&self) -> Vec<Entry<'_>> {
        let entry = |name, colour, symbol| Entry {
            name,
            colour,
            symbol,
        };
        match self {
            Self::Line {
                name,
                colour,
                dashed,
                ..
            } => {
                let symbol = if *dashed {
                    Symbol::Dashes
                } else {
                    Symbol::Line
                };
                vec![entry(name, *colour, symbol)]
            }
            Self::Dots { name, colour, .. } => vec![entry(name, *colour, Symbol::Area)],
            Self::Span {
                name,
                colour,
                opacity,
                ..
            } => vec![entry(name, over_white(*colour, *opacity), Symbol::Area)],
            Self::Cells { palette, .. } => palette
                .iter()
                .map(|(name, colour)| entry(name, *colour, Symbol::Area))
                .collect(),
            Self::Label { .. } => Vec::new(),
        }
    }
}

/// An entry of a legend.
struct Entry<'a> {
    name: &'a str,
    colour: RGBColor,
    symbol: Symbol,
}

/// The symbol of a legend entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Symbol {
    Line,
    Dashes,
    Area,
}

impl Chart {
    /// Returns the figure as SVG text.
    ///
    /// # Errors
    /// [`PlotError::Draw`] if the drawing library fails, which is not expected.
    pub fn svg(&self) -> Result<String, PlotError> {
        let x = self.x_range();
        let laid_out: Vec<Placed<'_>> = self
            .panels
            .iter()
            .scan(TITLE_HEIGHT, |top, panel| {
                let placed = Placed::new(panel, *top, x.clone());
                *top = placed.bottom + GAP;
                Some(placed)
            })
            .collect();
        let bottom = laid_out.last().map_or(TITLE_HEIGHT, |placed| placed.bottom);
        style::svg((WIDTH, bottom + AXIS_HEIGHT), |root| {
            text(root, &self.title, &TITLE, (LEFT, 44), HPos::Left)?;
            text(root, &self.subtitle, &SUBTITLE, (LEFT, 90), HPos::Left)?;
            for placed in &laid_out {
                placed.draw(root)?;
            }
            let (values, step) = ticks(&x, X_TICKS);
            for value in values {
                let at = (x_pixel(&x, value), bottom + 26);
                text(root, &label(value, step), &TICK, at, HPos::Center)?;
            }
            let middle = ((LEFT + WIDTH - RIGHT) / 2, bottom + 68);
            text(root, &self.x_title, &HEADING, middle, HPos::Center)
        })
    }

    fn x_range(&self) -> Range<f64> {
        self.x.clone().unwrap_or_else(|| {
            let points = self.panels.iter().flat_map(|panel| &panel.marks);
            let values = points.flat_map(|mark| mark.points().iter().map(|point| point.0));
            let (low, high) = values
                .filter(|value| value.is_finite())
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
                    (low.min(value), high.max(value))
                });
            if low < high { low..high } else { 0.0..1.0 }
        })
    }
}

#[cfg(test)]
mod tests;

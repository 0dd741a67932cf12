//! The elements of a panel.

use std::ops::Range;

use super::Panel;
use crate::style::Colour;

/// An element of a panel; a named element appears in the legend.
#[derive(Clone, Debug)]
pub enum Mark {
    /// Points joined by straight lines; a NaN interrupts the line.
    Line {
        /// Name in the legend.
        name: String,
        /// Colour.
        colour: Colour,
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
        colour: Colour,
        /// Diameter in drawn units.
        size: i32,
        /// Points in any order.
        points: Vec<(f64, f64)>,
    },
    /// The area between two curves; a NaN interrupts it.
    Band {
        /// Name in the legend.
        name: String,
        /// Colour.
        colour: Colour,
        /// Position, lower and upper value, from first to last.
        points: Vec<(f64, f64, f64)>,
    },
    /// Filled rectangles.
    Bars {
        /// Name in the legend.
        name: String,
        /// Colour.
        colour: Colour,
        /// Ends of each along both axes.
        bars: Vec<(Range<f64>, Range<f64>)>,
    },
    /// Intervals of the shared axis, shaded over the panel's height.
    Spans {
        /// Name in the legend.
        name: String,
        /// Colour.
        colour: Colour,
        /// Opacity, from 0 (clear) to 1 (solid).
        opacity: f64,
        /// The intervals.
        x: Vec<Range<f64>>,
    },
    /// A value marked across the panel.
    Level {
        /// The value.
        value: f64,
        /// Colour.
        colour: Colour,
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
        palette: Vec<(String, Colour)>,
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
    pub fn line(name: &str, colour: Colour, points: Vec<(f64, f64)>) -> Self {
        Self::Line {
            name: name.into(),
            colour,
            width: 4,
            dashed: false,
            points,
        }
    }

    /// Creates a dashed line.
    pub fn dashed(name: &str, colour: Colour, points: Vec<(f64, f64)>) -> Self {
        Self::Line {
            name: name.into(),
            colour,
            width: 4,
            dashed: true,
            points,
        }
    }

    /// Returns the points that the axes must show.
    pub(super) fn points(&self) -> Vec<(f64, f64)> {
        match self {
            Self::Line { points, .. } | Self::Dots { points, .. } => points.clone(),
            Self::Band { points, .. } => points
                .iter()
                .flat_map(|&(x, low, high)| [(x, low), (x, high)])
                .collect(),
            Self::Bars { bars, .. } => bars
                .iter()
                .flat_map(|(x, y)| [(x.start, y.start), (x.end, y.end)])
                .collect(),
            Self::Level { value, .. } => vec![(f64::NAN, *value)],
            Self::Spans { .. } | Self::Cells { .. } | Self::Label { .. } => Vec::new(),
        }
    }

    /// Returns the entries for the legend.
    fn legend(&self) -> Vec<LegendEntry<'_>> {
        let entry = |name, colour, symbol| LegendEntry {
            name,
            colour,
            symbol,
        };
        match self {
            Self::Line {
                name,
                colour,
                dashed,
                width,
                ..
            } => {
                let symbol = Symbol::Line {
                    width: *width,
                    dashed: *dashed,
                };
                vec![entry(name, *colour, symbol)]
            }
            Self::Dots { name, colour, .. } => vec![entry(name, *colour, Symbol::Dot)],
            Self::Spans {
                name,
                colour,
                opacity,
                ..
            } => vec![entry(name, *colour, Symbol::Area { opacity: *opacity })],
            Self::Bars { name, colour, .. } => {
                vec![entry(name, *colour, Symbol::Area { opacity: 1.0 })]
            }
            Self::Band { name, colour, .. } => {
                let opacity = BAND_OPACITY;
                vec![entry(name, *colour, Symbol::Area { opacity })]
            }
            Self::Cells { palette, .. } => palette
                .iter()
                .map(|(name, colour)| entry(name, *colour, Symbol::Area { opacity: 1.0 }))
                .collect(),
            Self::Level { .. } | Self::Label { .. } => Vec::new(),
        }
    }
}

/// Opacity of a [`Mark::Band`].
pub(super) const BAND_OPACITY: f64 = 0.3;

/// An entry of a legend.
#[derive(Clone, Copy, Debug)]
pub(super) struct LegendEntry<'a> {
    pub(super) name: &'a str,
    pub(super) colour: Colour,
    pub(super) symbol: Symbol,
}

/// The symbol of a legend entry.
#[derive(Clone, Copy, Debug)]
pub(super) enum Symbol {
    Line { width: u32, dashed: bool },
    Dot,
    Area { opacity: f64 },
}

impl Panel {
    /// Returns the legend entries of the panel's named elements.
    pub(super) fn legend(&self) -> Vec<LegendEntry<'_>> {
        let entries = self.marks.iter().flat_map(Mark::legend);
        entries.filter(|entry| !entry.name.is_empty()).collect()
    }
}

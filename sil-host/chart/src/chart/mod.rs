//! Figures: panels of curves, points and regions, stacked over one shared axis or side by side.

mod heading;
mod mark;
mod placed;

use std::ops::Range;

use crate::axis::label;
use crate::canvas::{Anchor, Canvas};
use crate::style::{HEADING, LABEL, SUBTITLE, TITLE, Ticks, WIDTH, text_width, ticks, wrapped};
use heading::{Heading, ROW};
pub use mark::Mark;
use placed::{Placed, x_pixel};

/// Left end of the panels, drawn units; the labels of the value axis are to the left.
pub const LEFT: i32 = 170;
/// Distance of the panels from the right end of the figure, drawn units.
pub const RIGHT: i32 = 50;
const TITLE_ROW: i32 = 54;
const TOP: i32 = 16;
const GAP: i32 = 28;

/// A figure.
#[derive(Clone, Debug, Default)]
pub struct Chart {
    /// Title of the figure.
    pub title: String,
    /// Lines below the title: a verdict, parameters common to all panels.
    pub subtitle: String,
    /// Name and unit of the axis that all panels share.
    pub x_title: String,
    /// Ends of the shared axis; by default those of all points.
    pub x: Option<Range<f64>>,
    /// Labels of the shared axis and their positions; round numbers by default.
    pub x_labels: Option<Vec<(f64, String)>>,
    /// Panels from left to right, then from top to bottom.
    pub panels: Vec<Panel>,
    /// Number of panels side by side; zero is one.
    pub columns: usize,
    /// Whether one legend above the panels serves all of them.
    pub one_legend: bool,
}

/// A panel of a figure.
#[derive(Clone, Debug)]
pub struct Panel {
    /// Name and unit of the value axis.
    pub title: String,
    /// Note on how to read the panel.
    pub note: String,
    /// Unit of the value axis, for the note on values off the scale.
    pub unit: String,
    /// Title and ends of an axis of its own instead of the shared one.
    pub x: Option<(String, Range<f64>)>,
    /// Labels of that axis and their positions; round numbers by default.
    pub x_labels: Option<Vec<(f64, String)>>,
    /// Ends of the value axis; by default those of all points.
    pub y: Option<Range<f64>>,
    /// Smallest span of an axis chosen from the points, so that noise on a constant stays small.
    pub minimum_span: f64,
    /// Approximate number of value labels; zero for a strip without values.
    pub y_ticks: usize,
    /// Labels of the value axis and their positions; round numbers by default.
    pub y_labels: Option<Vec<(f64, String)>>,
    /// Height in drawn units; a whole figure is [`WIDTH`] wide.
    pub height: i32,
    /// Contents, from bottom to top; maps are below and labels above everything else.
    pub marks: Vec<Mark>,
}

impl Default for Panel {
    fn default() -> Self {
        Self {
            title: String::new(),
            note: String::new(),
            unit: String::new(),
            x: None,
            x_labels: None,
            y: None,
            minimum_span: 0.0,
            y_ticks: 6,
            y_labels: None,
            height: 420,
            marks: Vec::new(),
        }
    }
}

impl Chart {
    /// Returns the figure as SVG text.
    pub fn svg(&self) -> String {
        let mut canvas = Canvas::default();
        let mut top = TOP;
        for (text, look, row) in [
            (&self.title, &TITLE, TITLE_ROW),
            (&self.subtitle, &SUBTITLE, ROW),
        ] {
            for line in text
                .lines()
                .flat_map(|line| wrapped(line, look, WIDTH - 2 * RIGHT))
            {
                canvas.text(&line, look, (RIGHT, top + row / 2), Anchor::Left);
                top += row;
            }
        }
        if self.one_legend {
            let panels = self.panels.iter();
            let mut entries: Vec<_> = panels.flat_map(Panel::legend).collect();
            let mut seen = std::collections::BTreeSet::new();
            entries.retain(|entry| seen.insert(entry.name));
            let legend = Heading::new("", "", entries, RIGHT..WIDTH - RIGHT);
            legend.draw(&mut canvas, top);
            top += legend.height();
        }
        top += GAP / 2;

        let x = self.x_range();
        let columns = self.columns.max(1);
        let mut bottoms = vec![top; columns];
        for row in self.panels.chunks(columns) {
            let placed: Vec<_> = row
                .iter()
                .zip(column_sides(columns))
                .map(|(panel, sides)| Placed::new(panel, sides, &x, self))
                .collect();
            let heading = placed.iter().map(Placed::heading_height).max().unwrap_or(0);
            let mut bottom = top;
            for (panel, column) in placed.iter().zip(&mut bottoms) {
                *column = panel.draw(&mut canvas, top + heading);
                bottom = bottom.max(*column);
            }
            top = bottom + GAP;
        }
        let is_shared = self.panels.iter().any(|panel| panel.x.is_none());
        let mut end = bottoms.iter().copied().max().unwrap_or(top);
        for (sides, bottom) in column_sides(columns).into_iter().zip(&bottoms) {
            if is_shared {
                let labels = x_labels(self.x_labels.as_ref(), &x, &sides);
                let below = draw_x_axis(&mut canvas, &labels, &self.x_title, &x, &sides, *bottom);
                end = end.max(below);
            }
        }
        canvas.finish((WIDTH, end + TOP), &self.title, &self.subtitle)
    }

    fn x_range(&self) -> Range<f64> {
        self.x.clone().unwrap_or_else(|| {
            let points = self.panels.iter().flat_map(|panel| &panel.marks);
            let values = points.flat_map(|mark| mark.points().into_iter().map(|point| point.0));
            let (low, high) = values
                .filter(|value| value.is_finite())
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
                    (low.min(value), high.max(value))
                });
            if low < high {
                low..high
            } else if low == high {
                // A single point is in the middle.
                let half = 0.1 * low.abs().max(1e-3);
                low - half..low + half
            } else {
                0.0..1.0
            }
        })
    }
}

/// Draws labels and title below a panel; returns the lower end.
fn draw_x_axis(
    canvas: &mut Canvas,
    labels: &[(f64, String)],
    title: &str,
    x: &Range<f64>,
    sides: &Range<i32>,
    bottom: i32,
) -> i32 {
    for (value, name) in labels {
        let at = (x_pixel(x, sides, *value), bottom + 26);
        canvas.text(name, &LABEL, at, Anchor::Middle);
    }
    let mut row = bottom + 50;
    for line in wrapped(title, &HEADING, sides.end - sides.start + RIGHT) {
        let middle = ((sides.start + sides.end) / 2, row + ROW / 2);
        canvas.text(&line, &HEADING, middle, Anchor::Middle);
        row += ROW;
    }
    row
}

/// Returns the left and right ends of the panels of each column.
fn column_sides(columns: usize) -> Vec<Range<i32>> {
    let pitch = WIDTH / columns as i32;
    (0..columns as i32)
        .map(|column| column * pitch + LEFT..(column + 1) * pitch - RIGHT)
        .collect()
}

/// Returns the given labels of an axis, or round numbers.
fn x_labels(
    given: Option<&Vec<(f64, String)>>,
    x: &Range<f64>,
    sides: &Range<i32>,
) -> Vec<(f64, String)> {
    given.map_or_else(|| round_labels(x, sides), Clone::clone)
}

/// Returns as many round numbers as have room along an axis.
fn round_labels(x: &Range<f64>, sides: &Range<i32>) -> Vec<(f64, String)> {
    for count in (1..=10).rev() {
        let Ticks { values, step } = ticks(x, count);
        let labels: Vec<_> = values
            .into_iter()
            .map(|value| (value, label(value, step)))
            .collect();
        let widths = labels.iter().map(|(_, name)| text_width(name, &LABEL));
        let widest = widths.max().unwrap_or(0) + 40;
        if widest * labels.len() as i32 <= sides.end - sides.start + widest {
            return labels;
        }
    }
    Vec::new()
}

#[cfg(test)]
mod tests;

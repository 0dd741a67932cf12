//! The figures of studies: stacked panels of curves, points and regions over one axis.

use std::ops::Range;

use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use super::PlotError;
use super::axis::{ValueAxis, label};
use super::decimate::Extent;
use super::style::{
    self, Area, Drawn, GREY, GRID, HEADING, LEGEND, NOTE, SUBTITLE, TICK, TITLE, over_white, text,
    text_width, ticks, without_straight_ons,
};

const WIDTH: i32 = 2000;
const LEFT: i32 = 170;
const RIGHT: i32 = 50;
const TITLE_HEIGHT: i32 = 124;
const ROW: i32 = 50;
const GAP: i32 = 24;
const AXIS_HEIGHT: i32 = 110;
const LEGEND_LINE: i32 = 66;
const X_TICKS: usize = 12;

/// A figure.
#[derive(Clone, Debug, Default)]
pub struct Chart {
    /// What the figure shows.
    pub title: String,
    /// Parameters that hold for all of it; about 110 characters.
    pub subtitle: String,
    /// Name and unit of the axis that all panels share.
    pub x_title: String,
    /// Its ends; those of all points if absent.
    pub x: Option<Range<f64>>,
    /// From top to bottom.
    pub panels: Vec<Panel>,
}

/// One of a figure's panels.
#[derive(Clone, Debug)]
pub struct Panel {
    /// Name and unit of the value axis.
    pub title: String,
    /// How to read the panel.
    pub note: String,
    /// Ends of the value axis; those of all points if absent.
    pub y: Option<Range<f64>>,
    /// About how many values are labelled; none for a strip without values.
    pub y_ticks: usize,
    /// Height in drawn units; a whole figure is 2000 wide.
    pub height: i32,
    /// What is in it, from the bottom to the top.
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

/// Something in a panel; what has a name is in the legend.
#[derive(Clone, Debug)]
pub enum Mark {
    /// Points joined by straight lines; a NaN interrupts them.
    Line {
        /// For the legend.
        name: String,
        /// Colour.
        colour: RGBColor,
        /// Width in drawn units.
        width: u32,
        /// Dashed instead of solid.
        dashed: bool,
        /// From the first to the last.
        points: Vec<(f64, f64)>,
    },
    /// Points each for itself.
    Dots {
        /// For the legend.
        name: String,
        /// Colour.
        colour: RGBColor,
        /// Side of the square in drawn units.
        size: i32,
        /// In any order.
        points: Vec<(f64, f64)>,
    },
    /// A stretch of the axis, shaded over the panel's height.
    Span {
        /// For the legend.
        name: String,
        /// Colour.
        colour: RGBColor,
        /// 0 for clear to 1 for solid.
        opacity: f64,
        /// From where to where.
        x: Range<f64>,
    },
    /// A map of equal cells.
    Cells {
        /// Ends of the map along the shared axis.
        x: Range<f64>,
        /// Ends of the map along the value axis.
        y: Range<f64>,
        /// Cells from left to right.
        columns: usize,
        /// Names and colours.
        palette: Vec<(String, RGBColor)>,
        /// Place in the palette of each cell, row by row from the bottom, left to right;
        /// a place that is not there leaves the cell clear.
        cells: Vec<u8>,
    },
    /// Words in the panel.
    Label {
        /// Where their middle is, or their left end.
        at: (f64, f64),
        /// Whether `at` is the middle.
        centred: bool,
        /// The words.
        text: String,
    },
}

impl Mark {
    /// A solid line.
    pub fn line(name: &str, colour: RGBColor, points: Vec<(f64, f64)>) -> Self {
        Self::Line {
            name: name.into(),
            colour,
            width: 3,
            dashed: false,
            points,
        }
    }

    /// A dashed line.
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

    /// Names and colours for the legend, and whether they are lines.
    fn legend(&self) -> Vec<(&str, RGBColor, bool)> {
        match self {
            Self::Line { name, colour, .. } => vec![(name.as_str(), *colour, true)],
            Self::Dots { name, colour, .. } => vec![(name.as_str(), *colour, false)],
            Self::Span {
                name,
                colour,
                opacity,
                ..
            } => vec![(name.as_str(), over_white(*colour, *opacity), false)],
            Self::Cells { palette, .. } => palette
                .iter()
                .map(|(name, colour)| (name.as_str(), *colour, false))
                .collect(),
            Self::Label { .. } => Vec::new(),
        }
    }
}

impl Chart {
    /// The figure as SVG text.
    ///
    /// # Errors
    /// [`PlotError::Draw`] if the drawing library refuses, which it has no reason to.
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

/// A panel with its place in the figure and its scales.
struct Placed<'a> {
    panel: &'a Panel,
    legend_below_heading: bool,
    heading_top: i32,
    top: i32,
    bottom: i32,
    x: Range<f64>,
    axis: ValueAxis,
}

impl<'a> Placed<'a> {
    fn new(panel: &'a Panel, heading_top: i32, x: Range<f64>) -> Self {
        let legend: i32 = legend(panel)
            .iter()
            .map(|(name, ..)| legend_width(name))
            .sum();
        let words = text_width(&panel.title, &HEADING) + text_width(&panel.note, &NOTE) + 60;
        let legend_below_heading = words + legend > WIDTH - LEFT - RIGHT;
        let rows = if legend_below_heading { 2 } else { 1 };
        let top = heading_top + rows * ROW;
        let axis = match &panel.y {
            Some(range) => ValueAxis {
                range: range.clone(),
                off_scale_min: None,
                off_scale_max: None,
            },
            None => {
                let points = panel.marks.iter().flat_map(Mark::points);
                ValueAxis::new(points.map(|point| Extent::of(point.1)), None, 1e-9)
            }
        };
        Self {
            panel,
            legend_below_heading,
            heading_top,
            top,
            bottom: top + panel.height,
            x,
            axis,
        }
    }

    fn x(&self, value: f64) -> i32 {
        x_pixel(&self.x, value)
    }

    fn y(&self, value: f64) -> i32 {
        let Range { start, end } = self.axis.range;
        let part = (self.axis.clamp(value) - start) / (end - start);
        self.bottom - (part * f64::from(self.panel.height)).round() as i32
    }

    fn draw(&self, root: &Area<'_>) -> Drawn {
        let middle = self.heading_top + ROW / 2;
        let note = match self.axis.off_scale_note("") {
            off_scale if off_scale.is_empty() => self.panel.note.clone(),
            off_scale => format!("{} {off_scale}", self.panel.note),
        };
        text(
            root,
            &self.panel.title,
            &HEADING,
            (LEFT, middle),
            HPos::Left,
        )?;
        let after_title = LEFT + text_width(&self.panel.title, &HEADING) + 60;
        text(root, &note, &NOTE, (after_title, middle), HPos::Left)?;
        self.draw_legend(root)?;

        // Maps cover the grid, everything else lies over it.
        let (maps, others): (Vec<&Mark>, Vec<&Mark>) = self
            .panel
            .marks
            .iter()
            .partition(|mark| matches!(mark, Mark::Cells { .. } | Mark::Span { .. }));
        for mark in maps {
            self.draw_mark(root, mark)?;
        }
        let (right, bottom) = (WIDTH - RIGHT, self.bottom);
        for value in ticks(&self.x, X_TICKS).0 {
            let x = self.x(value);
            line(root, [(x, self.top), (x, bottom)], GRID, 2)?;
        }
        if self.panel.y_ticks > 0 {
            let (values, step) = ticks(&self.axis.range, self.panel.y_ticks);
            for value in values {
                let y = self.y(value);
                line(root, [(LEFT, y), (right, y)], GRID, 2)?;
                text(
                    root,
                    &label(value, step),
                    &TICK,
                    (LEFT - 14, y),
                    HPos::Right,
                )?;
            }
        }
        for mark in others {
            self.draw_mark(root, mark)?;
        }
        let corners = [
            (LEFT, self.top),
            (right, self.top),
            (right, bottom),
            (LEFT, bottom),
            (LEFT, self.top),
        ];
        line(root, corners, GREY, 2)
    }

    fn draw_legend(&self, root: &Area<'_>) -> Drawn {
        let row = i32::from(self.legend_below_heading);
        let middle = self.heading_top + row * ROW + ROW / 2;
        let mut x = WIDTH - RIGHT;
        for (name, colour, is_line) in legend(self.panel).into_iter().rev() {
            x -= text_width(name, &LEGEND);
            text(root, name, &LEGEND, (x, middle), HPos::Left)?;
            x -= LEGEND_LINE + 14;
            if is_line {
                line(root, [(x, middle), (x + LEGEND_LINE, middle)], colour, 4)?;
            } else {
                let swatch = [(x + 30, middle - 14), (x + LEGEND_LINE, middle + 14)];
                root.draw(&Rectangle::new(swatch, colour.filled()))?;
                root.draw(&Rectangle::new(swatch, GREY.stroke_width(1)))?;
            }
            x -= 40;
        }
        Ok(())
    }

    fn draw_mark(&self, root: &Area<'_>, mark: &Mark) -> Drawn {
        match mark {
            Mark::Line {
                colour,
                width,
                dashed,
                points,
                ..
            } => {
                let style = colour.stroke_width(*width);
                let parts = points.split(|(x, y)| x.is_nan() || y.is_nan());
                for part in parts.filter(|part| !part.is_empty()) {
                    let pixels = part.iter().map(|&(x, y)| (self.x(x), self.y(y)));
                    let pixels = without_straight_ons(pixels);
                    if *dashed {
                        root.draw(&DashedPathElement::new(pixels, 14, 10, style))?;
                    } else {
                        root.draw(&PathElement::new(pixels, style))?;
                    }
                }
                Ok(())
            }
            Mark::Dots {
                colour,
                size,
                points,
                ..
            } => {
                let inside = |&&(x, y): &&(f64, f64)| {
                    self.x.start <= x
                        && x <= self.x.end
                        && self.axis.range.start <= y
                        && y <= self.axis.range.end
                };
                let points = points.iter().filter(inside);
                let mut pixels: Vec<_> = points.map(|&(x, y)| (self.x(x), self.y(y))).collect();
                // Most points of a diagram fall onto others.
                pixels.sort_unstable();
                pixels.dedup();
                for (x, y) in pixels {
                    let corner = (x - size / 2, y - size / 2);
                    let square = [corner, (corner.0 + size, corner.1 + size)];
                    root.draw(&Rectangle::new(square, colour.filled()))?;
                }
                Ok(())
            }
            Mark::Span {
                colour, opacity, x, ..
            } => {
                let (start, end) = (self.x(x.start), self.x(x.end));
                let corners = [(start, self.top), (end.max(start + 2), self.bottom)];
                root.draw(&Rectangle::new(corners, colour.mix(*opacity).filled()))
            }
            Mark::Cells {
                x,
                y,
                columns,
                palette,
                cells,
            } => self.draw_cells(root, (x, y), *columns, palette, cells),
            Mark::Label {
                at,
                centred,
                text: words,
            } => {
                let at = (self.x(at.0), self.y(at.1));
                let side = if *centred { HPos::Center } else { HPos::Left };
                text(root, words, &LEGEND, at, side)
            }
        }
    }

    fn draw_cells(
        &self,
        root: &Area<'_>,
        (x, y): (&Range<f64>, &Range<f64>),
        columns: usize,
        palette: &[(String, RGBColor)],
        cells: &[u8],
    ) -> Drawn {
        let rows = cells.len().div_ceil(columns.max(1));
        let at = |range: &Range<f64>, index: usize, count: usize| {
            range.start + (range.end - range.start) * index as f64 / count as f64
        };
        for (row, line) in cells.chunks(columns.max(1)).enumerate() {
            let low = self.y(at(y, row, rows));
            // One unit into the next row, which covers it, so that no seam shows.
            let high = (self.y(at(y, row + 1, rows)) - 1).max(self.top);
            // Neighbours of one colour are one rectangle.
            let mut start = 0;
            for run in line.chunk_by(|one, next| one == next) {
                let end = start + run.len();
                if let Some((_, colour)) = run
                    .first()
                    .and_then(|&place| palette.get(usize::from(place)))
                {
                    let left = self.x(at(x, start, columns));
                    let right = self.x(at(x, end, columns));
                    root.draw(&Rectangle::new(
                        [(left, high), (right, low)],
                        colour.filled(),
                    ))?;
                }
                start = end;
            }
        }
        Ok(())
    }
}

/// Names and colours of what is in a panel, and whether they are lines.
fn legend(panel: &Panel) -> Vec<(&str, RGBColor, bool)> {
    let entries = panel.marks.iter().flat_map(Mark::legend);
    entries.filter(|(name, ..)| !name.is_empty()).collect()
}

fn legend_width(name: &str) -> i32 {
    text_width(name, &LEGEND) + LEGEND_LINE + 54
}

fn x_pixel(range: &Range<f64>, value: f64) -> i32 {
    let part = (value - range.start) / (range.end - range.start);
    LEFT + (part.clamp(0.0, 1.0) * f64::from(WIDTH - RIGHT - LEFT)).round() as i32
}

fn line<const N: usize>(
    root: &Area<'_>,
    points: [(i32, i32); N],
    colour: RGBColor,
    width: u32,
) -> Drawn {
    root.draw(&PathElement::new(points, colour.stroke_width(width)))
}

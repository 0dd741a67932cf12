//! Panels placed in the figure, with their scales.

use std::ops::Range;

use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use super::{Entry, LEFT, Mark, Panel, RIGHT, ROW, Symbol, WIDTH, X_TICKS};
use crate::axis::{ValueAxis, label};
use crate::decimate::Extent;
use crate::style::{
    Area, Drawn, GREY, GRID, HEADING, LEGEND, NOTE, TICK, text, text_width, ticks,
    without_straight_ons,
};

/// Length of a line in a legend, drawn units.
const LEGEND_LINE: i32 = 66;

/// Lengths of dashes and gaps, drawn units.
const DASH: (u32, u32) = (14, 10);

/// A panel with its position in the figure and its scales.
pub(super) struct Placed<'a> {
    panel: &'a Panel,
    legend_below_heading: bool,
    heading_top: i32,
    top: i32,
    pub(super) bottom: i32,
    x: Range<f64>,
    axis: ValueAxis,
}

impl<'a> Placed<'a> {
    pub(super) fn new(panel: &'a Panel, heading_top: i32, x: Range<f64>) -> Self {
        let legend: i32 = legend(panel)
            .iter()
            .map(|entry| legend_width(entry.name))
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

    pub(super) fn draw(&self, root: &Area<'_>) -> Drawn {
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

        // Maps cover the grid lines; everything else is drawn over them.
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
        for entry in legend(self.panel).into_iter().rev() {
            x -= text_width(entry.name, &LEGEND);
            text(root, entry.name, &LEGEND, (x, middle), HPos::Left)?;
            x -= LEGEND_LINE + 14;
            let across = [(x, middle), (x + LEGEND_LINE, middle)];
            match entry.symbol {
                Symbol::Line => line(root, across, entry.colour, 4)?,
                Symbol::Dashes => dashes(root, across, entry.colour, 4)?,
                Symbol::Area => {
                    let area = [(x + 30, middle - 14), (x + LEGEND_LINE, middle + 14)];
                    root.draw(&Rectangle::new(area, entry.colour.filled()))?;
                    root.draw(&Rectangle::new(area, GREY.stroke_width(1)))?;
                }
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
                let parts = points.split(|(x, y)| x.is_nan() || y.is_nan());
                for part in parts.filter(|part| !part.is_empty()) {
                    let pixels = part.iter().map(|&(x, y)| (self.x(x), self.y(y)));
                    let pixels = without_straight_ons(pixels);
                    if *dashed {
                        dashes(root, pixels, *colour, *width)?;
                    } else {
                        let style = colour.stroke_width(*width);
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
                // Most points of a diagram coincide.
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
            // Extends one unit into the next row, which covers it, so that no seam shows.
            let high = (self.y(at(y, row + 1, rows)) - 1).max(self.top);
            // Adjacent cells of one colour form one rectangle.
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

/// Returns the legend entries of the panel's named elements.
fn legend(panel: &Panel) -> Vec<Entry<'_>> {
    let entries = panel.marks.iter().flat_map(Mark::legend);
    entries.filter(|entry| !entry.name.is_empty()).collect()
}

fn legend_width(name: &str) -> i32 {
    text_width(name, &LEGEND) + LEGEND_LINE + 54
}

pub(super) fn x_pixel(range: &Range<f64>, value: f64) -> i32 {
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

fn dashes(
    root: &Area<'_>,
    points: impl IntoIterator<Item = (i32, i32), IntoIter: Clone>,
    colour: RGBColor,
    width: u32,
) -> Drawn {
    let (dash, gap) = DASH;
    let style = colour.stroke_width(width);
    root.draw(&DashedPathElement::new(points, dash, gap, style))
}

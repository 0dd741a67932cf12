//! Panels placed in the figure, with their scales.

use std::ops::Range;

use super::heading::Heading;
use super::mark::{BAND_OPACITY, Mark};
use super::{Chart, Panel, draw_x_axis, x_labels};
use crate::axis::{ValueAxis, label};
use crate::canvas::{Anchor, At, Canvas, Fill, Stroke};
use crate::decimate::Extent;
use crate::style::{Colour, GREY, GRID, LABEL, Ticks, ticks, without_straight_ons};

/// Distance of the labels of the value axis from the panel, drawn units.
const LABEL_GAP: i32 = 12;
/// Half of the width, and the height, of a mark where a curve leaves its panel.
const OFF_SCALE: (i32, i32) = (9, 15);
/// Up to this many dots of one kind are at least this large, drawn units: a few small ones would
/// hardly be seen on a narrow screen.
const FEW_DOTS: (usize, i32) = (40, 14);

/// A panel with its position in the figure and its scales.
pub(super) struct Placed<'a> {
    panel: &'a Panel,
    heading: Heading<'a>,
    sides: Range<i32>,
    x: Range<f64>,
    x_labels: Vec<(f64, String)>,
    axis: ValueAxis,
}

/// A panel whose height in the figure is known.
struct Frame<'a, 'b> {
    placed: &'b Placed<'a>,
    top: i32,
    bottom: i32,
}

impl<'a> Placed<'a> {
    pub(super) fn new(panel: &'a Panel, sides: Range<i32>, x: &Range<f64>, chart: &Chart) -> Self {
        let axis = value_axis(panel);
        let mut note = panel.note.clone();
        let off_scale = axis.off_scale_note(&panel.unit);
        if !off_scale.is_empty() {
            note =
                [note.as_str(), off_scale.as_str()].join(if note.is_empty() { "" } else { "; " });
        }
        let entries = if chart.one_legend {
            Vec::new()
        } else {
            panel.legend()
        };
        let (x, given) = match &panel.x {
            Some((_, own)) => (own, &panel.x_labels),
            None => (x, &chart.x_labels),
        };
        let x_labels = x_labels(given.as_ref(), x, &sides);
        Self {
            panel,
            heading: Heading::new(&panel.title, &note, entries, sides.clone()),
            x_labels,
            sides,
            x: x.clone(),
            axis,
        }
    }

    pub(super) fn heading_height(&self) -> i32 {
        self.heading.height()
    }

    /// Draws the panel with its heading above `top`; returns its lower end.
    pub(super) fn draw(&self, canvas: &mut Canvas, top: i32) -> i32 {
        self.heading.draw(canvas, top - self.heading.height());
        let bottom = top + self.panel.height;
        Frame {
            placed: self,
            top,
            bottom,
        }
        .draw(canvas);
        match &self.panel.x {
            Some((title, _)) => {
                draw_x_axis(canvas, &self.x_labels, title, &self.x, &self.sides, bottom)
            }
            None => bottom,
        }
    }
}

/// Chooses the value axis of a panel.
fn value_axis(panel: &Panel) -> ValueAxis {
    if let Some(range) = &panel.y {
        return ValueAxis {
            range: range.clone(),
            off_scale_min: None,
            off_scale_max: None,
        };
    }
    let points = panel.marks.iter().flat_map(Mark::points);
    let level = panel.marks.iter().find_map(|mark| match mark {
        Mark::Level { value, .. } => Some(*value),
        _ => None,
    });
    let extents: Vec<Extent> = points.map(|point| Extent::of(point.1)).collect();
    let finite = || extents.iter().map(|e| e.min).filter(|v| v.is_finite());
    let least = finite().fold(f64::INFINITY, f64::min);
    // A constant alone must not stretch its last digits over the panel.
    let constant = finite().all(|value| value == least);
    let span = if constant && least.is_finite() {
        0.1 * least.abs()
    } else {
        0.0
    };
    let span = panel.minimum_span.max(span).max(1e-9);
    ValueAxis::new(extents.into_iter(), level, span)
}

impl Frame<'_, '_> {
    fn x(&self, value: f64) -> i32 {
        x_pixel(&self.placed.x, &self.placed.sides, value)
    }

    fn y(&self, value: f64) -> i32 {
        let Range { start, end } = self.placed.axis.range;
        let part = (self.placed.axis.clamp(value) - start) / (end - start);
        self.bottom - (part * f64::from(self.bottom - self.top)).round() as i32
    }

    fn draw(&self, canvas: &mut Canvas) {
        let panel = self.placed.panel;
        // Maps cover the grid lines; everything else is drawn over them, the labels last.
        let (maps, others): (Vec<&Mark>, Vec<&Mark>) = panel
            .marks
            .iter()
            .partition(|mark| matches!(mark, Mark::Cells { .. } | Mark::Spans { .. }));
        for mark in maps {
            self.draw_mark(canvas, mark);
        }
        let Range { start, end } = self.placed.sides;
        let grid = Stroke::solid(GRID, 2);
        for (value, _) in &self.placed.x_labels {
            let x = self.x(*value);
            canvas.line(&[(x, self.top), (x, self.bottom)], grid);
        }
        for (value, name) in self.y_labels() {
            let y = self.y(value);
            if panel.y_labels.is_none() {
                canvas.line(&[(start, y), (end, y)], grid);
            }
            canvas.text(&name, &LABEL, (start - LABEL_GAP, y), Anchor::Right);
        }
        let (labels, others): (Vec<&Mark>, Vec<&Mark>) = others
            .into_iter()
            .partition(|mark| matches!(mark, Mark::Label { .. }));
        for mark in others.into_iter().chain(labels) {
            self.draw_mark(canvas, mark);
        }
        let corners = [
            (start, self.top),
            (end, self.top),
            (end, self.bottom),
            (start, self.bottom),
            (start, self.top),
        ];
        canvas.line(&corners, Stroke::solid(GREY, 2));
    }

    fn y_labels(&self) -> Vec<(f64, String)> {
        let panel = self.placed.panel;
        if let Some(labels) = &panel.y_labels {
            return labels.clone();
        }
        if panel.y_ticks == 0 {
            return Vec::new();
        }
        let room = (self.bottom - self.top) / (LABEL.size * 13 / 10);
        let count = panel.y_ticks.min(room.max(1) as usize);
        let Ticks { values, step } = ticks(&self.placed.axis.range, count);
        let values = values.into_iter();
        values.map(|value| (value, label(value, step))).collect()
    }

    fn draw_mark(&self, canvas: &mut Canvas, mark: &Mark) {
        match mark {
            Mark::Line {
                colour,
                width,
                dashed,
                points,
                ..
            } => {
                let stroke = Stroke {
                    colour: *colour,
                    width: *width,
                    dashed: *dashed,
                };
                for part in points.split(|(x, y)| x.is_nan() || y.is_nan()) {
                    let pixels = part.iter().map(|&(x, y)| (self.x(x), self.y(y)));
                    let pixels = without_straight_ons(pixels);
                    if !pixels.is_empty() {
                        canvas.line(&pixels, stroke);
                    }
                }
                self.draw_off_scale_marks(canvas, points, *colour);
            }
            Mark::Dots {
                colour,
                size,
                points,
                ..
            } => self.draw_dots(canvas, points, *size, *colour),
            Mark::Band { colour, points, .. } => {
                let fill = Fill {
                    colour: *colour,
                    opacity: BAND_OPACITY,
                };
                for part in points.split(|(x, low, high)| (x + low + high).is_nan()) {
                    let there = part.iter().map(|&(x, low, _)| (self.x(x), self.y(low)));
                    let back = part.iter().rev();
                    let back = back.map(|&(x, _, high)| (self.x(x), self.y(high)));
                    let outline = without_straight_ons(there.chain(back));
                    if outline.len() > 2 {
                        canvas.polygon(&outline, fill);
                    }
                }
            }
            Mark::Bars { colour, bars, .. } => {
                let corners: Vec<_> = bars
                    .iter()
                    .map(|(x, y)| {
                        let (left, right) = (self.x(x.start), self.x(x.end));
                        let (low, high) = (self.y(y.start), self.y(y.end));
                        // The shortest is still seen.
                        [(left, high), (right.max(left + 3), low)]
                    })
                    .collect();
                canvas.rectangles(&corners, Fill::solid(*colour));
            }
            Mark::Spans {
                colour, opacity, x, ..
            } => {
                let corners: Vec<_> = x
                    .iter()
                    .map(|x| {
                        let (start, end) = (self.x(x.start), self.x(x.end));
                        [(start, self.top), (end.max(start + 2), self.bottom)]
                    })
                    .collect();
                let fill = Fill {
                    colour: *colour,
                    opacity: *opacity,
                };
                canvas.rectangles(&corners, fill);
            }
            Mark::Level { value, colour } => {
                let Range { start, end } = self.placed.sides;
                let y = self.y(*value);
                canvas.line(&[(start, y), (end, y)], Stroke::solid(*colour, 3));
            }
            Mark::Cells {
                x,
                y,
                columns,
                palette,
                cells,
            } => self.draw_cells(canvas, (x, y), *columns, palette, cells),
            Mark::Label { at, centred, text } => {
                let at = (self.x(at.0), self.y(at.1));
                let anchor = if *centred {
                    Anchor::Middle
                } else {
                    Anchor::Left
                };
                canvas.text_over_lines(text, &LABEL, at, anchor);
            }
        }
    }

    fn draw_dots(&self, canvas: &mut Canvas, points: &[(f64, f64)], size: i32, colour: Colour) {
        let inside = |&&(x, y): &&(f64, f64)| {
            let (across, up) = (&self.placed.x, &self.placed.axis.range);
            across.start <= x && x <= across.end && up.start <= y && y <= up.end
        };
        let points = points.iter().filter(inside);
        let mut pixels: Vec<At> = points.map(|&(x, y)| (self.x(x), self.y(y))).collect();
        // Most points of a diagram coincide.
        pixels.sort_unstable();
        pixels.dedup();
        let size = match FEW_DOTS {
            (few, least) if pixels.len() <= few => size.max(least),
            _ => size,
        };
        if size >= 8 {
            canvas.circles(&pixels, size / 2, colour);
            return;
        }
        // Small dots are squares in one shape: a diagram has tens of thousands.
        let corners: Vec<_> = pixels
            .into_iter()
            .map(|(x, y)| {
                let (left, top) = (x - size / 2, y - size / 2);
                [(left, top), (left + size, top + size)]
            })
            .collect();
        canvas.rectangles(&corners, Fill::solid(colour));
    }

    /// Draws a small triangle at the edge where a curve leaves the panel.
    fn draw_off_scale_marks(&self, canvas: &mut Canvas, points: &[(f64, f64)], colour: Colour) {
        let (half, height) = OFF_SCALE;
        let axis = &self.placed.axis;
        let above = axis.off_scale_max.map(|_| (self.top, height));
        let below = axis.off_scale_min.map(|_| (self.bottom, -height));
        for (edge, height) in [above, below].into_iter().flatten() {
            let mut free_from = i32::MIN;
            for &(x, y) in points {
                let beyond = if height > 0 {
                    y > axis.range.end
                } else {
                    y < axis.range.start
                };
                let x = self.x(x);
                if x < free_from || !beyond {
                    continue;
                }
                free_from = x + 2 * half;
                let tip_and_base = [
                    (x, edge),
                    (x - half, edge + height),
                    (x + half, edge + height),
                ];
                canvas.polygon(&tip_and_base, Fill::solid(colour));
            }
        }
    }

    fn draw_cells(
        &self,
        canvas: &mut Canvas,
        (x, y): (&Range<f64>, &Range<f64>),
        columns: usize,
        palette: &[(String, Colour)],
        cells: &[u8],
    ) {
        let columns = columns.max(1);
        let rows = cells.len().div_ceil(columns);
        let at = |range: &Range<f64>, index: usize, count: usize| {
            range.start + (range.end - range.start) * index as f64 / count as f64
        };
        // One shape for each colour, in which adjacent cells of a row form one rectangle.
        let mut shapes = vec![Vec::new(); palette.len()];
        for (row, line) in cells.chunks(columns).enumerate() {
            let low = self.y(at(y, row, rows));
            // Extends one unit into the next row, so that no seam shows.
            let high = (self.y(at(y, row + 1, rows)) - 1).max(self.top);
            let mut start = 0;
            for run in line.chunk_by(|one, next| one == next) {
                let end = start + run.len();
                let place = run.first().map_or(usize::MAX, |place| usize::from(*place));
                if let Some(shape) = shapes.get_mut(place) {
                    let left = self.x(at(x, start, columns));
                    let right = self.x(at(x, end, columns));
                    shape.push([(left, high), (right, low)]);
                }
                start = end;
            }
        }
        for ((_, colour), shape) in palette.iter().zip(&shapes) {
            canvas.rectangles(shape, Fill::solid(*colour));
        }
    }
}

pub(super) fn x_pixel(range: &Range<f64>, sides: &Range<i32>, value: f64) -> i32 {
    let part = (value - range.start) / (range.end - range.start);
    sides.start + (part.clamp(0.0, 1.0) * f64::from(sides.end - sides.start)).round() as i32
}

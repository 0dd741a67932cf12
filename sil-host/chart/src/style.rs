//! Colours, fonts and ticks common to all figures, in SVG at twice the displayed size.

use std::io;
use std::ops::Range;

use plotters::coord::Shift;
use plotters::coord::ranged1d::Ranged;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::PlotError;

// The palette of Okabe and Ito, distinguishable by colour-blind readers and in grey.

/// Near black, for text and for the reference of a comparison.
pub const BLACK_INK: RGBColor = RGBColor(0x1A, 0x1A, 0x1A);
/// Blue, for the first curve.
pub const BLUE_INK: RGBColor = RGBColor(0x00, 0x72, 0xB2);
/// Light blue.
pub const SKY: RGBColor = RGBColor(0x56, 0xB4, 0xE9);
/// Green.
pub const GREEN: RGBColor = RGBColor(0x00, 0x9E, 0x73);
/// Orange.
pub const ORANGE: RGBColor = RGBColor(0xE6, 0x9F, 0x00);
/// Red, for failures.
pub const VERMILLION: RGBColor = RGBColor(0xD5, 0x5E, 0x00);
/// Grey, for notes and for the background.
pub const GREY: RGBColor = RGBColor(0x70, 0x70, 0x70);
/// Light grey, for grids.
pub const GRID: RGBColor = RGBColor(0xE4, 0xE4, 0xE4);

/// Figures are drawn at twice the displayed size, because coordinates are whole pixels.
pub const DRAWN_PER_SHOWN: i32 = 2;
/// Font family, with fallbacks.
pub const FONT: &str = "Helvetica, Arial, Liberation Sans, DejaVu Sans, sans-serif";
/// Size, weight and colour of a text.
pub struct Look {
    /// Height, drawn units.
    pub size: i32,
    weight: FontStyle,
    colour: RGBColor,
}

impl Look {
    const fn new(size: i32, weight: FontStyle, colour: RGBColor) -> Self {
        Self {
            size,
            weight,
            colour,
        }
    }
}

/// Title of a figure.
pub const TITLE: Look = Look::new(46, FontStyle::Bold, BLACK_INK);
/// Line below the title.
pub const SUBTITLE: Look = Look::new(31, FontStyle::Normal, GREY);
/// Title of a panel.
pub const HEADING: Look = Look::new(33, FontStyle::Bold, BLACK_INK);
/// Names of curves.
pub const LEGEND: Look = Look::new(31, FontStyle::Normal, BLACK_INK);
/// Notes.
pub const NOTE: Look = Look::new(29, FontStyle::Normal, GREY);
/// Numbers at the axes.
pub const TICK: Look = Look::new(29, FontStyle::Normal, BLACK_INK);

/// A region of a figure being drawn.
pub type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
/// Result of a call to the drawing library.
pub type Drawn = Result<(), DrawingAreaErrorKind<io::Error>>;

/// Draws a figure of `size` (width, height) in drawn units.
///
/// # Errors
/// [`PlotError::Draw`] if the drawing library fails.
pub fn svg(size: (i32, i32), draw: impl FnOnce(&Area<'_>) -> Drawn) -> Result<String, PlotError> {
    let (width, height) = size;
    let mut svg = String::new();
    {
        let backend = SVGBackend::with_string(&mut svg, (width as u32, height as u32));
        let root = backend.into_drawing_area();
        root.fill(&WHITE)
            .and_then(|()| draw(&root))
            .and_then(|()| root.present())
            .map_err(|error| PlotError::Draw(error.to_string()))?;
    }
    let drawn = format!(r#"width="{width}" height="{height}""#);
    let shown = format!(
        r#"width="{}" height="{}" stroke-linejoin="round""#,
        width / DRAWN_PER_SHOWN,
        height / DRAWN_PER_SHOWN
    );
    Ok(svg.replacen(&drawn, &shown, 1))
}

/// Returns the opaque colour that looks like a translucent one on white.
pub fn over_white(colour: RGBColor, opacity: f64) -> RGBColor {
    let mix = |part: u8| (255.0 + (f64::from(part) - 255.0) * opacity.clamp(0.0, 1.0)) as u8;
    RGBColor(mix(colour.0), mix(colour.1), mix(colour.2))
}

/// Returns about `count` round values within a range, and their spacing.
pub fn ticks(range: &Range<f64>, count: usize) -> (Vec<f64>, f64) {
    // Rounding must not drop a tick at the very end.
    let slack = 1e-6 * (range.end - range.start);
    let ticks = RangedCoordf64::from(range.start - slack..range.end + slack).key_points(count);
    let step = match ticks.as_slice() {
        [first, second, ..] => second - first,
        _ => range.end - range.start,
    };
    (ticks, step)
}

/// Removes points on a straight vertical or horizontal run to the next point.
pub fn without_straight_ons(points: impl Iterator<Item = (i32, i32)>) -> Vec<(i32, i32)> {
    let mut kept: Vec<(i32, i32)> = Vec::new();
    for next in points {
        match *kept.as_slice() {
            [.., last] if last == next => continue,
            [.., before, last] => {
                let upright = before.0 == last.0 && last.0 == next.0;
                let level = before.1 == last.1 && last.1 == next.1;
                let onwards = (last.0 - before.0) * (next.0 - last.0) >= 0
                    && (last.1 - before.1) * (next.1 - last.1) >= 0;
                if (upright || level) && onwards {
                    kept.pop();
                }
            }
            _ => {}
        }
        kept.push(next);
    }
    kept
}

/// Estimates the width of a text in a common font; only the viewer knows the true width.
pub fn text_width(text: &str, look: &Look) -> i32 {
    text.chars().count() as i32 * look.size * 45 / 100
}

/// Draws a text at a point, aligned left, right or centred.
///
/// # Errors
/// The error of the drawing library.
pub fn text(root: &Area<'_>, text: &str, look: &Look, at: (i32, i32), side: HPos) -> Drawn {
    if text.is_empty() {
        return Ok(());
    }
    let style = TextStyle::from((FONT, look.size, look.weight))
        .color(&look.colour)
        .pos(Pos::new(side, VPos::Center));
    root.draw_text(text, &style, at)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_on_a_straight_run_are_removed_but_corners_are_kept() {
        let points = [
            (0, 0),
            (0, 5),
            (0, 9),
            (0, 2),
            (0, 2),
            (3, 2),
            (8, 2),
            (9, 3),
        ];
        assert_eq!(
            without_straight_ons(points.into_iter()),
            [(0, 0), (0, 9), (0, 2), (8, 2), (9, 3)]
        );
    }
}

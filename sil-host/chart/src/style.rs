//! Colours, fonts, widths of text and ticks common to all figures.
//!
//! A figure is [`WIDTH`] units wide and shown at half that. Labels are [`SMALL`] high, so that they
//! are 9 px high when a narrow screen shows the figure 400 px wide.

use std::ops::Range;

/// A colour: red, green and blue.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Colour(pub u8, pub u8, pub u8);

// The palette of Okabe and Ito, distinguishable by colour-blind readers and in grey.

/// Near black, for text and for the reference of a comparison.
pub const BLACK_INK: Colour = Colour(0x1A, 0x1A, 0x1A);
/// Blue, for the first curve.
pub const BLUE_INK: Colour = Colour(0x00, 0x72, 0xB2);
/// Light blue.
pub const SKY: Colour = Colour(0x56, 0xB4, 0xE9);
/// Green.
pub const GREEN: Colour = Colour(0x00, 0x9E, 0x73);
/// Orange.
pub const ORANGE: Colour = Colour(0xE6, 0x9F, 0x00);
/// Purple.
pub const PURPLE: Colour = Colour(0xCC, 0x79, 0xA7);
/// Red, for failures.
pub const VERMILLION: Colour = Colour(0xD5, 0x5E, 0x00);
/// Grey, for notes and for the background.
pub const GREY: Colour = Colour(0x66, 0x66, 0x66);
/// Light grey, for grids.
pub const GRID: Colour = Colour(0xE4, 0xE4, 0xE4);
/// Lightest grey, for cells in which nothing happens.
pub const QUIET: Colour = Colour(0xF2, 0xF2, 0xF2);
/// The paper.
pub const WHITE: Colour = Colour(0xFF, 0xFF, 0xFF);

/// Width of a figure, drawn units.
pub const WIDTH: i32 = 1400;
/// Figures are drawn at twice the displayed size, because coordinates are whole units.
pub const DRAWN_PER_SHOWN: i32 = 2;
/// Height of the smallest labels, drawn units.
pub const SMALL: i32 = 32;
/// Font family, with fallbacks.
pub const FONT: &str = "Helvetica, Arial, Liberation Sans, DejaVu Sans, sans-serif";

/// Size, weight and colour of a text.
#[derive(Clone, Copy, Debug)]
pub struct Look {
    /// Height, drawn units.
    pub size: i32,
    /// Whether the text is bold.
    pub bold: bool,
    /// Colour.
    pub colour: Colour,
}

const fn look(size: i32, bold: bool, colour: Colour) -> Look {
    Look { size, bold, colour }
}

/// Title of a figure.
pub const TITLE: Look = look(40, true, BLACK_INK);
/// Lines below the title.
pub const SUBTITLE: Look = look(SMALL, false, GREY);
/// Title of a panel.
pub const HEADING: Look = look(SMALL, true, BLACK_INK);
/// Names of curves, and numbers at the axes.
pub const LABEL: Look = look(SMALL, false, BLACK_INK);
/// Notes.
pub const NOTE: Look = look(SMALL, false, GREY);

/// Returns the opaque colour that looks like a translucent one on white.
pub fn over_white(colour: Colour, opacity: f64) -> Colour {
    let mix = |part: u8| (255.0 + (f64::from(part) - 255.0) * opacity.clamp(0.0, 1.0)) as u8;
    Colour(mix(colour.0), mix(colour.1), mix(colour.2))
}

/// Round values along an axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Ticks {
    /// The values.
    pub values: Vec<f64>,
    /// Their spacing: 1, 2 or 5 times a power of ten.
    pub step: f64,
}

/// Returns about `count` round values within a range.
pub fn ticks(range: &Range<f64>, count: usize) -> Ticks {
    let span = range.end - range.start;
    let coarsest = span / count.max(1) as f64;
    let power = 10_f64.powf(coarsest.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|factor| factor * power)
        .find(|step| *step >= coarsest * (1.0 - 1e-9));
    let Some(step) = step.filter(|step| step.is_normal()) else {
        return Ticks {
            values: Vec::new(),
            step: span,
        };
    };
    // Rounding must not drop a tick at the very end.
    let slack = 1e-6 * span;
    let (first, last) = (
        ((range.start - slack) / step).ceil(),
        ((range.end + slack) / step).floor(),
    );
    // At such a distance from zero, adjacent ticks are the same number.
    if last.abs().max(first.abs()) > 1e15 {
        return Ticks {
            values: Vec::new(),
            step,
        };
    }
    let values = (first as i64..=last as i64).map(|tick| tick as f64 * step);
    Ticks {
        values: values.collect(),
        step,
    }
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

/// Estimates the width of a text; only the viewer knows the true width. The widths are those of
/// DejaVu Sans, the widest of the fonts.
pub fn text_width(text: &str, look: &Look) -> i32 {
    let thousandths: i32 = text.chars().map(character_width).sum();
    let bold = if look.bold { 110 } else { 100 };
    thousandths * look.size / 1000 * bold / 100
}

/// Returns the width of a character, thousandths of the font's height.
fn character_width(character: char) -> i32 {
    match character {
        // Placed over the letter before it.
        '\u{307}' => 0,
        'i' | 'j' | 'l' | '\'' | ' ' | ',' | '.' | ':' | ';' | '|' | '·' => 320,
        'f' | 'r' | 't' | 'I' | '(' | ')' | '[' | ']' | '!' | '/' | '-' => 400,
        '₁' | '₂' | 'ₜ' | 'ₙ' | 'ᵣ' | '₀' | '²' | '³' => 420,
        'm' | 'w' | 'M' | 'W' | '%' | '…' | '@' | '→' => 980,
        '<' | '>' | '=' | '+' | '−' | '≤' | '≥' | '≈' | '±' | '∞' => 838,
        'A'..='Z' => 720,
        _ => 630,
    }
}

/// Breaks a text at spaces into lines no wider than `width`; a longer word gets a line of its own.
pub fn wrapped(text: &str, look: &Look, width: i32) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split(' ').filter(|word| !word.is_empty()) {
        match lines.last_mut() {
            Some(line) if text_width(&format!("{line} {word}"), look) <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
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

    #[test]
    fn ticks_are_round_and_within_the_range() {
        let six = ticks(&(0.0..6.0), 6);
        assert_eq!(six.values, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        assert_eq!(six.step, 1.0);
        let three = ticks(&(-0.31..0.25), 4);
        assert_eq!(
            (&three.values[..], three.step),
            (&[-0.2, 0.0, 0.2][..], 0.2)
        );
        assert_eq!(ticks(&(1e20..1e20 + 1e5), 4).values, []);
        assert_eq!(ticks(&(5.0..5.0), 4).values, []);
    }

    #[test]
    fn long_texts_are_broken_at_spaces() {
        let lines = wrapped("one two  three", &LABEL, text_width("one two", &LABEL));
        assert_eq!(lines, ["one two", "three"]);
        assert_eq!(wrapped("", &LABEL, 100), Vec::<String>::new());
    }
}

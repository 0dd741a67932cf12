//! Shapes and text as an SVG file, with a title for screen readers and colours for dark screens.

use std::collections::BTreeSet;
use std::fmt::Write;

use crate::style::{Colour, DRAWN_PER_SHOWN, FONT, Look, WHITE};
use crate::{dark, markup};

/// A point in drawn units, (right, down).
pub type At = (i32, i32);

/// Lengths of dashes and gaps, drawn units.
const DASHES: &str = "14 10";

/// Side of a text that is at its point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anchor {
    /// The text extends to the right.
    Left,
    /// The text extends to both sides.
    Middle,
    /// The text extends to the left.
    Right,
}

/// How a line is drawn.
#[derive(Clone, Copy, Debug)]
pub struct Stroke {
    /// Colour.
    pub colour: Colour,
    /// Width, drawn units.
    pub width: u32,
    /// Dashed instead of solid.
    pub dashed: bool,
}

impl Stroke {
    /// A solid line.
    pub fn solid(colour: Colour, width: u32) -> Self {
        Self {
            colour,
            width,
            dashed: false,
        }
    }
}

/// The area of a shape.
#[derive(Clone, Copy, Debug)]
pub struct Fill {
    /// Colour.
    pub colour: Colour,
    /// Opacity, from 0 (clear) to 1 (solid).
    pub opacity: f64,
}

impl Fill {
    /// An opaque area.
    pub fn solid(colour: Colour) -> Self {
        Self {
            colour,
            opacity: 1.0,
        }
    }
}

/// A figure being drawn.
#[derive(Clone, Debug, Default)]
pub struct Canvas {
    body: String,
    colours: BTreeSet<Colour>,
}

impl Canvas {
    /// Draws a line through points; one point is a dot.
    pub fn line(&mut self, points: &[At], stroke: Stroke) {
        self.colours.insert(stroke.colour);
        let (colour, width) = (hex(stroke.colour), stroke.width);
        if let [(x, y)] = points {
            let radius = width / 2 + 2;
            self.element(format_args!(
                r#"<circle cx="{x}" cy="{y}" r="{radius}" fill="{colour}"/>"#
            ));
            return;
        }
        let dashes = match stroke.dashed {
            true => format!(r#" stroke-dasharray="{DASHES}""#),
            false => String::new(),
        };
        let points = joined(points);
        self.element(format_args!(
            r#"<polyline fill="none" stroke="{colour}" stroke-width="{width}"{dashes} points="{points}"/>"#
        ));
    }

    /// Fills a polygon.
    pub fn polygon(&mut self, points: &[At], fill: Fill) {
        let (fill, points) = (self.fill(fill), joined(points));
        self.element(format_args!(r#"<polygon {fill} points="{points}"/>"#));
    }

    /// Fills rectangles, each given by two opposite corners, as one shape.
    pub fn rectangles(&mut self, corners: &[[At; 2]], fill: Fill) {
        if corners.is_empty() {
            return;
        }
        let mut path = String::new();
        for [(left, top), (right, bottom)] in corners {
            let (width, height) = (right - left, bottom - top);
            // Writing to a string cannot fail.
            let _ = write!(path, "M{left} {top}h{width}v{height}h{}z", -width);
        }
        let fill = self.fill(fill);
        self.element(format_args!(r#"<path {fill} d="{path}"/>"#));
    }

    /// Fills circles of one radius.
    pub fn circles(&mut self, middles: &[At], radius: i32, colour: Colour) {
        let fill = self.fill(Fill::solid(colour));
        for (x, y) in middles {
            self.element(format_args!(
                r#"<circle cx="{x}" cy="{y}" r="{radius}" {fill}/>"#
            ));
        }
    }

    /// Draws a text whose middle height is at a point.
    pub fn text(&mut self, words: &str, look: &Look, at: At, anchor: Anchor) {
        self.write(words, look, at, anchor, "");
    }

    /// Draws a text with a margin in the ground's colour, so that lines below it do not cross it.
    pub fn text_over_lines(&mut self, words: &str, look: &Look, at: At, anchor: Anchor) {
        let margin = format!(
            r#" stroke="{}" stroke-width="10" paint-order="stroke""#,
            hex(WHITE)
        );
        self.write(words, look, at, anchor, &margin);
    }

    fn write(&mut self, words: &str, look: &Look, (x, y): At, anchor: Anchor, margin: &str) {
        if words.is_empty() {
            return;
        }
        let anchor = match anchor {
            Anchor::Left => "start",
            Anchor::Middle => "middle",
            Anchor::Right => "end",
        };
        let weight = if look.bold {
            r#" font-weight="bold""#
        } else {
            ""
        };
        let fill = self.fill(Fill::solid(look.colour));
        let (size, words) = (look.size, spans(words));
        self.element(format_args!(
            r#"<text x="{x}" y="{y}" dy=".35em" text-anchor="{anchor}" font-size="{size}"{weight} {fill}{margin}>{words}</text>"#
        ));
    }

    /// Returns the SVG file of a figure of `size` (width, height) in drawn units.
    pub fn finish(self, size: (i32, i32), title: &str, description: &str) -> String {
        let (width, height) = size;
        let [shown_width, shown_height] = [width, height].map(|side| side / DRAWN_PER_SHOWN);
        let [title, description] = [title, description].map(escaped);
        let mut colours = self.colours;
        colours.insert(WHITE);
        let dark: String = colours
            .iter()
            .map(|&colour| {
                let (light, dark) = (hex(colour), hex(dark::of(colour)));
                format!(
                    ".chart [fill=\"{light}\"]{{fill:{dark}}}.chart [stroke=\"{light}\"]{{stroke:{dark}}}"
                )
            })
            .collect();
        let (white, body) = (hex(WHITE), self.body);
        format!(
            r#"<svg xmlns="http://www.w3.org/2000/svg" class="chart" width="{shown_width}" height="{shown_height}" viewBox="0 0 {width} {height}" style="max-width:100%;height:auto" font-family="{FONT}" stroke-linejoin="round" role="img" aria-label="{title}. {description}">
<title>{title}</title>
<style>@media (prefers-color-scheme:dark){{{dark}}}</style>
<rect width="{width}" height="{height}" fill="{white}"/>
{body}</svg>
"#
        )
    }

    fn fill(&mut self, fill: Fill) -> String {
        self.colours.insert(fill.colour);
        let colour = hex(fill.colour);
        if fill.opacity < 1.0 {
            format!(r#"fill="{colour}" fill-opacity="{}""#, fill.opacity)
        } else {
            format!(r#"fill="{colour}""#)
        }
    }

    fn element(&mut self, element: std::fmt::Arguments<'_>) {
        // Writing to a string cannot fail.
        let _ = writeln!(self.body, "{element}");
    }
}

fn hex(Colour(red, green, blue): Colour) -> String {
    format!("#{red:02X}{green:02X}{blue:02X}")
}

fn joined(points: &[At]) -> String {
    let points: Vec<String> = points.iter().map(|(x, y)| format!("{x},{y}")).collect();
    points.join(" ")
}

/// Escapes text for XML, which allows neither control characters nor the last two of its first plane.
fn escaped(text: &str) -> String {
    let is_refused =
        |character: char| character.is_control() || ('\u{fffe}'..='\u{ffff}').contains(&character);
    markup::escaped(&text.replace(is_refused, " "))
}

/// Returns a text in which the dot of a time derivative is a full stop raised over its letter. Few
/// fonts have the combining dot for θ, and renderers put it beside the letter or leave it out.
fn spans(words: &str) -> String {
    let mut parts = words.split('\u{307}');
    let mut text = escaped(parts.next().unwrap_or_default());
    for part in parts {
        text.push_str(r#"<tspan dx="-.45em" dy="-.8em">.</tspan>"#);
        let mut rest = part.chars();
        if let Some(next) = rest.next() {
            let next = escaped(&next.to_string());
            text.push_str(&format!(r#"<tspan dx=".14em" dy=".8em">{next}</tspan>"#));
        }
        text.push_str(&escaped(rest.as_str()));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::style::{BLACK_INK, LABEL};

    #[test]
    fn a_figure_has_a_title_dark_colours_and_escaped_text() {
        let mut canvas = Canvas::default();
        canvas.text(
            "a < b\u{7}\u{fffe}\u{ffff}\u{fffd}",
            &LABEL,
            (1, 2),
            Anchor::Left,
        );
        canvas.line(&[(3, 4)], Stroke::solid(BLACK_INK, 4));
        let svg = canvas.finish((20, 10), "T & U", "more");
        for part in [
            r#"width="10" height="5" viewBox="0 0 20 10""#,
            r#"role="img" aria-label="T &amp; U. more""#,
            "<title>T &amp; U</title>",
            "prefers-color-scheme:dark",
            ">a &lt; b   \u{fffd}</text>",
            r#"<circle cx="3" cy="4" r="4""#,
        ] {
            assert!(svg.contains(part), "{part} is not in {svg}");
        }
    }

    #[test]
    fn the_dot_of_a_rate_is_over_its_letter_and_the_rest_on_the_line() {
        assert_eq!(
            spans("θ\u{307}₁ (1/s)"),
            "θ<tspan dx=\"-.45em\" dy=\"-.8em\">.</tspan><tspan dx=\".14em\" dy=\".8em\">₁</tspan> (1/s)"
        );
        assert_eq!(spans("plain"), "plain");
    }
}

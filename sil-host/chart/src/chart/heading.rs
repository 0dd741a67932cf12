//! The rows above a panel: title, legend and note, in as many rows as they need.

use std::ops::Range;

use super::mark::{LegendEntry, Symbol};
use crate::canvas::{Anchor, Canvas, Fill, Stroke};
use crate::style::{GREY, HEADING, LABEL, Look, NOTE, text_width, wrapped};

/// Height of a row of text, drawn units.
pub(super) const ROW: i32 = 44;
/// Length of a symbol in the legend, drawn units.
const SYMBOL: i32 = 50;
const SYMBOL_GAP: i32 = 12;
const ENTRY_GAP: i32 = 36;

/// Words of the heading, with their row and left end.
struct Words {
    row: i32,
    left: i32,
    text: String,
    look: Look,
}

/// A heading laid out between the sides of its panel.
pub(super) struct Heading<'a> {
    rows: i32,
    words: Vec<Words>,
    /// Legend entries with the row and left end of each.
    entries: Vec<(i32, i32, LegendEntry<'a>)>,
}

impl<'a> Heading<'a> {
    pub(super) fn new(
        title: &str,
        note: &str,
        entries: Vec<LegendEntry<'a>>,
        sides: Range<i32>,
    ) -> Self {
        let width = sides.end - sides.start;
        let mut heading = Self {
            rows: 0,
            words: Vec::new(),
            entries: Vec::new(),
        };
        heading.add_words(title, &HEADING, &sides);
        let title_width = match heading.words.as_slice() {
            [only] => text_width(&only.text, &HEADING) + ENTRY_GAP,
            _ => width,
        };
        let note_width = text_width(note, &NOTE) + ENTRY_GAP;
        let legend_width: i32 = entries.iter().map(entry_width).sum();
        let note_fits = !note.is_empty() && title_width + note_width <= width;
        let used = title_width + if note_fits { note_width } else { 0 };
        let legend_fits = heading.rows > 0 && used + legend_width <= width;
        if note_fits {
            heading.words.push(Words {
                row: 0,
                left: sides.start + title_width,
                text: note.into(),
                look: NOTE,
            });
        }
        let mut left = sides.end + ENTRY_GAP - legend_width;
        if !legend_fits {
            left = sides.start;
        }
        let mut row = if legend_fits { 0 } else { heading.rows };
        for entry in entries {
            let taken = entry_width(&entry);
            if left > sides.start && left + taken - ENTRY_GAP > sides.end {
                left = sides.start;
                row += 1;
            }
            heading.entries.push((row, left, entry));
            heading.rows = heading.rows.max(row + 1);
            left += taken;
        }
        if !note_fits {
            heading.add_words(note, &NOTE, &sides);
        }
        heading
    }

    fn add_words(&mut self, text: &str, look: &Look, sides: &Range<i32>) {
        for text in wrapped(text, look, sides.end - sides.start) {
            self.words.push(Words {
                row: self.rows,
                left: sides.start,
                text,
                look: *look,
            });
            self.rows += 1;
        }
    }

    pub(super) fn height(&self) -> i32 {
        self.rows * ROW
    }

    pub(super) fn draw(&self, canvas: &mut Canvas, top: i32) {
        for words in &self.words {
            let at = (words.left, top + words.row * ROW + ROW / 2);
            canvas.text(&words.text, &words.look, at, Anchor::Left);
        }
        for (row, left, entry) in &self.entries {
            let middle = top + row * ROW + ROW / 2;
            draw_symbol(canvas, entry, (*left, middle));
            let at = (left + SYMBOL + SYMBOL_GAP, middle);
            canvas.text(entry.name, &LABEL, at, Anchor::Left);
        }
    }
}

fn draw_symbol(canvas: &mut Canvas, entry: &LegendEntry<'_>, (left, middle): (i32, i32)) {
    let right = left + SYMBOL;
    match entry.symbol {
        Symbol::Line { width, dashed } => {
            let stroke = Stroke {
                colour: entry.colour,
                width: width.min(12),
                dashed,
            };
            canvas.line(&[(left, middle), (right, middle)], stroke);
        }
        Symbol::Dot => canvas.circles(&[(left + SYMBOL - 12, middle)], 9, entry.colour),
        Symbol::Area { opacity } => {
            let (left, top, bottom) = (left + 14, middle - 13, middle + 13);
            let colour = entry.colour;
            canvas.rectangles(&[[(left, top), (right, bottom)]], Fill { colour, opacity });
            // The outline shows colours that hardly differ from the ground.
            let outline = [
                (left, top),
                (right, top),
                (right, bottom),
                (left, bottom),
                (left, top),
            ];
            canvas.line(&outline, Stroke::solid(GREY, 1));
        }
    }
}

fn entry_width(entry: &LegendEntry<'_>) -> i32 {
    SYMBOL + SYMBOL_GAP + text_width(entry.name, &LABEL) + ENTRY_GAP
}

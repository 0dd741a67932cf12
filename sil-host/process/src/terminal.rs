//! Standard output and standard error, of which either may be closed or full; tables for readers.

use std::fmt::Display;
use std::io::{self, Write};

use comfy_table::presets::UTF8_FULL_CONDENSED;
use comfy_table::{Cell, ColumnConstraint, ContentArrangement, Row, Table, Width};
use rustix::termios::tcgetwinsize;

/// Writes a line to standard output.
///
/// # Errors
/// [`io::ErrorKind::BrokenPipe`] if the reader has closed the pipe; other errors if the line is
/// lost.
pub fn say(line: impl Display) -> io::Result<()> {
    let mut stdout = io::stdout();
    writeln!(stdout, "{line}")?;
    stdout.flush()
}

/// Writes a line to standard error, [in ASCII](readable) where the locale asks for it. Errors are ignored: a full disk under its log must not end a
/// run.
pub fn warn(line: impl Display) {
    let _ = writeln!(io::stderr(), "{}", readable(line));
}

/// Returns whether the locale asks for ASCII: `C` or `POSIX` in the first of `LC_ALL`, `LC_CTYPE` and
/// `LANG` that is set. Without any, text is UTF-8.
pub fn is_ascii_only() -> bool {
    ["LC_ALL", "LC_CTYPE", "LANG"]
        .into_iter()
        .filter_map(std::env::var_os)
        .find(|locale| !locale.is_empty())
        .is_some_and(|locale| locale == "C" || locale == "POSIX")
}

/// Returns an empty table in the style of all tables. Its lines are broken to fit the terminal, or the
/// number of columns in `COLUMNS`.
pub fn table(header: impl Into<Row>) -> Table {
    let mut table = Table::new();
    table
        .load_style(UTF8_FULL_CONDENSED)
        .set_content_arrangement(ContentArrangement::Dynamic)
        .set_header(header);
    if let Some(columns) = columns() {
        table.set_width(columns);
    }
    table
}

/// Returns the width of tables, if it is limited.
fn columns() -> Option<u16> {
    let named = std::env::var("COLUMNS").ok();
    let named = named.and_then(|columns| columns.parse().ok());
    named
        .or_else(|| Some(tcgetwinsize(io::stdout()).ok()?.ws_col))
        .filter(|&columns| columns > 0)
}

/// Returns a text for readers: without control characters, and in ASCII where the locale asks for it.
pub fn readable(text: impl Display) -> String {
    let mut printable = String::new();
    for character in text.to_string().chars() {
        // A name from somebody else's file must not steer the terminal.
        if character.is_control() && !matches!(character, '\n' | '\t') {
            printable.extend(character.escape_default());
        } else {
            printable.push(character);
        }
    }
    if is_ascii_only() {
        to_ascii(&printable)
    } else {
        printable
    }
}

/// Returns a table for readers: in ASCII where the locale asks for it, and with one line for each cell
/// where the terminal is too narrow for the words of a row.
pub fn readable_table(table: Table) -> String {
    // Before the widths are chosen: some replacements are wider than their symbols.
    let text = narrow(with_cells(table, |text| readable(text))).to_string();
    if is_ascii_only() {
        to_ascii(&text)
    } else {
        text
    }
}

/// Returns a table that breaks lines between words only. A table of too many columns for its width gets a
/// line for each cell, named by the header, and an empty line between two rows; empty cells are left out.
fn narrow(mut table: Table) -> Table {
    let Some((header, width)) = table.header().zip(table.width()) else {
        return table;
    };
    let names: Vec<String> = header.cell_iter().map(Cell::content).collect();
    let rows: Vec<Vec<String>> = table
        .row_iter()
        .map(|row| row.cell_iter().map(Cell::content).collect())
        .collect();
    let longest_word = |column: usize| {
        let cells = rows.iter().filter_map(|row| row.get(column));
        let words = cells
            .chain(names.get(column))
            .flat_map(|cell| cell.split_whitespace());
        let letters = words.map(|word| word.chars().count()).max().unwrap_or(0);
        u16::try_from(letters).unwrap_or(u16::MAX)
    };
    // With a space on either side.
    let least: Vec<u16> = (0..names.len())
        .map(|column| longest_word(column).saturating_add(2))
        .collect();
    let borders = least.len() + 1;
    if least.iter().copied().map(usize::from).sum::<usize>() + borders <= usize::from(width) {
        let bounds = least
            .into_iter()
            .map(|width| ColumnConstraint::LowerBoundary(Width::Fixed(width)));
        table.set_constraints(bounds);
        return table;
    }
    let mut lines = self::table(["quantity", "value"]);
    lines.set_width(width);
    for (index, row) in rows.iter().enumerate() {
        if index > 0 {
            lines.add_row(["", ""]);
        }
        let named = names.iter().zip(row).filter(|(_, cell)| !cell.is_empty());
        lines.add_rows(named.map(|(name, cell)| [name, cell]));
    }
    lines
}

/// Returns a table with the text of each cell replaced.
fn with_cells(mut table: Table, replaced: impl Fn(&str) -> String) -> Table {
    let replaced = |row: &Row| -> Vec<Cell> {
        let cells = row.cell_iter();
        cells
            .map(|cell| Cell::new(replaced(&cell.content())))
            .collect()
    };
    if let Some(header) = table.header().map(replaced) {
        table.set_header(header);
    }
    for row in table.row_iter_mut() {
        *row = Row::from(replaced(row));
    }
    table
}

/// Returns a text in ASCII: symbols by their usual replacement, other letters as `?`.
pub fn to_ascii(text: &str) -> String {
    let replace = |letter| match letter {
        'μ' | 'µ' => "u",
        'θ' => "theta",
        '₀' => "0",
        '₁' => "1",
        '₂' => "2",
        'ₜ' => "t",
        'ₙ' => "n",
        'ᵣ' => "r",
        // The dot of a time derivative.
        '\u{307}' => "'",
        '∞' => "inf",
        '°' => "deg",
        '²' => "^2",
        '³' => "^3",
        '·' => ".",
        '×' => "x",
        '±' => "+-",
        '−' | '–' | '─' | '═' => "-",
        '…' => "...",
        '≤' => "<=",
        '≥' => ">=",
        '→' => "->",
        '│' | '┆' => "|",
        '┌' | '┐' | '└' | '┘' | '├' | '┤' | '┬' | '┴' | '┼' | '╞' | '╡' | '╪' => {
            "+"
        }
        _ => "?",
    };
    let mut ascii = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            letter if letter.is_ascii() => ascii.push(letter),
            letter => ascii.push_str(replace(letter)),
        }
    }
    ascii
}

#[cfg(test)]
mod tests {
    use super::{narrow, readable, readable_table, table, to_ascii, with_cells};

    #[test]
    fn control_characters_are_shown_and_not_sent() {
        assert_eq!(readable("a\u{1b}[31m\tb\n"), "a\\u{1b}[31m\tb\n");
        let mut table = table(["file"]);
        table.add_row(["a\u{1b}[31m"]);
        let text = readable_table(table);
        assert!(
            text.contains("a\\u{1b}[31m") && !text.contains('\u{1b}'),
            "{text}"
        );
    }

    #[test]
    fn tables_and_units_become_ascii() {
        assert_eq!(to_ascii("│ μ ┆ 3 m/s² ± 1 … │"), "| u | 3 m/s^2 +- 1 ... |");
        assert_eq!(to_ascii("zₜ, θ̇₁"), "zt, theta'1");
    }

    #[test]
    fn the_lines_of_a_table_in_ascii_are_equally_wide() {
        let mut table = table(["μ", "θ₁ (°)"]);
        table.add_row(["0.1 … 0.2", "≤ 3"]).add_row(["0", "1"]);
        let text = to_ascii(&with_cells(table, to_ascii).to_string());
        let widths: Vec<usize> = text.lines().map(str::len).collect();
        assert!(widths.iter().all(|width| *width == widths[0]), "{text}");
        assert!(text.contains("| 0.1 ... 0.2 | <= 3         |"), "{text}");
    }
    #[test]
    fn a_narrow_table_breaks_no_word() {
        let rows = |width: u16| {
            let mut table = table(["controller", "posture", "slides to (m)"]);
            table
                .set_width(width)
                .add_row(["hybrid", "elbow-down", "0.1644"]);
            table.add_row(["pid", "elbow-up", ""]);
            narrow(table).to_string()
        };
        assert!(rows(36).contains("│ controller ┆"), "{}", rows(36));
        let folded = rows(35);
        assert!(
            folded.lines().all(|line| line.chars().count() <= 35),
            "{folded}"
        );
        for line in [
            "│ controller    ┆ hybrid     │",
            "│ slides to (m) ┆ 0.1644     │",
            "│ posture       ┆ elbow-up   │",
        ] {
            assert!(folded.contains(line), "{folded}");
        }
        assert_eq!(folded.matches("slides to (m)").count(), 1, "{folded}");
    }
}

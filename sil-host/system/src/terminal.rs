//! Standard output and standard error, of which either may be closed or full; tables for readers.

use std::fmt::Display;
use std::io::{self, Write};

use comfy_table::presets::UTF8_FULL_CONDENSED;
use comfy_table::{ContentArrangement, Row, Table};

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
    let columns = std::env::var("COLUMNS").ok();
    if let Some(columns) = columns.and_then(|columns| columns.parse().ok()) {
        table.set_width(columns);
    }
    table
}

/// Returns a text for readers: in ASCII where the locale asks for it.
pub fn readable(text: impl Display) -> String {
    let text = text.to_string();
    if is_ascii_only() {
        to_ascii(&text)
    } else {
        text
    }
}

/// Returns a text in ASCII: symbols by their usual replacement, other letters as `?`.
pub fn to_ascii(text: &str) -> String {
    let replace = |letter| match letter {
        'μ' | 'µ' => "u",
        'θ' => "theta",
        '₁' => "1",
        '₂' => "2",
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
    use super::to_ascii;

    #[test]
    fn tables_and_units_become_ascii() {
        assert_eq!(to_ascii("│ μ ┆ 3 m/s² ± 1 … │"), "| u | 3 m/s^2 +- 1 ... |");
    }
}

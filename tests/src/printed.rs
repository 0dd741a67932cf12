//! Figures printed in the documentation, compared with measured ones.
//!
//! A part of a page begins with `<!-- measured: NAME -->` and ends with `<!-- end -->`. Its figures may
//! differ a little from what this build measures, its words and its limits may not.

use std::path::{Path, PathBuf};

/// Largest difference between a printed figure and the measured one, relative to the measured one.
const TOLERANCE: f64 = 0.03;

const UPDATE: &str = "to update it, run this test with UPDATE_DOCUMENTATION=1";

/// Whether the last figure of every line is a limit, which must be printed exactly.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LastFigure {
    /// It is a limit.
    Limit,
    /// It is measured like the others.
    Measured,
}

/// Compares a part of a page of `docs/` with its expected text, or writes that text if
/// `UPDATE_DOCUMENTATION` is set.
///
/// # Panics
/// If the page has no such part, or if the part is not up to date.
pub fn check(page: &str, name: &str, expected: &str, last: LastFigure) {
    let path = page_path(page);
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{page}: {error}"));
    let begin = format!("<!-- measured: {name} -->\n");
    let parts = text.split_once(&begin).and_then(|(before, rest)| {
        let (present, after) = rest.split_once("<!-- end -->")?;
        Some((before, present, after))
    });
    let Some((before, present, after)) = parts else {
        panic!("docs/{page} has no part '{name}'");
    };
    if std::env::var_os("UPDATE_DOCUMENTATION").is_some() {
        let text = format!("{before}{begin}\n{expected}\n<!-- end -->{after}");
        std::fs::write(&path, text).unwrap_or_else(|error| panic!("{page}: {error}"));
        return;
    }
    if let Err(reason) = compare(present.trim(), expected.trim(), last) {
        panic!("docs/{page}, part '{name}': {reason}; {UPDATE}");
    }
}

/// Compares a row of a table of a page of `docs/` with its expected text, whose last figure is a limit, or writes that text
/// if `UPDATE_DOCUMENTATION` is set.
///
/// # Panics
/// If no row has the same first cell, or if the row is not up to date.
pub fn check_row(page: &str, expected: &str) {
    let path = page_path(page);
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{page}: {error}"));
    let cell = expected.split('|').nth(1).unwrap_or_default();
    let begin = format!("|{cell}|");
    let Some(present) = text.lines().find(|line| line.starts_with(&begin)) else {
        panic!("docs/{page} has no row '{cell}'");
    };
    if std::env::var_os("UPDATE_DOCUMENTATION").is_some() {
        let text = text.replace(present, expected);
        std::fs::write(&path, text).unwrap_or_else(|error| panic!("{page}: {error}"));
        return;
    }
    if let Err(reason) = compare(present, expected, LastFigure::Limit) {
        panic!("docs/{page}: {reason}; {UPDATE}");
    }
}

/// Compares a figure of `docs/images/` with its expected text, or writes it if `UPDATE_DOCUMENTATION` is set.
///
/// # Panics
/// If the figure is not up to date.
pub fn check_figure(name: &str, expected: &str) {
    let path = page_path("images").join(name);
    if std::env::var_os("UPDATE_DOCUMENTATION").is_some() {
        std::fs::write(&path, expected).unwrap_or_else(|error| panic!("{name}: {error}"));
    }
    assert!(
        std::fs::read_to_string(&path).is_ok_and(|present| present == expected),
        "docs/images/{name} is not up to date; {UPDATE}"
    );
}

fn page_path(page: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../docs")
        .join(page)
}

/// Returns a whole number with commas between its thousands.
pub fn thousands(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (place, digit) in digits.chars().enumerate() {
        if place > 0 && (digits.len() - place).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

fn compare(present: &str, expected: &str, last: LastFigure) -> Result<(), String> {
    if present.lines().count() != expected.lines().count() {
        return Err(format!("other lines than\n{expected}"));
    }
    for (present, expected) in present.lines().zip(expected.lines()) {
        let (words, figures) = split(present);
        let (expected_words, expected_figures) = split(expected);
        if words != expected_words || figures.len() != expected_figures.len() {
            return Err(format!("'{present}' instead of '{expected}'"));
        }
        let count = figures.len();
        for (index, (printed, measured)) in figures.iter().zip(&expected_figures).enumerate() {
            let is_limit = last == LastFigure::Limit && index + 1 == count;
            let tolerance = if is_limit { 0.0 } else { TOLERANCE * measured };
            if (printed - measured).abs() > tolerance {
                return Err(format!("'{present}' instead of '{expected}'"));
            }
        }
    }
    Ok(())
}

/// Returns a line with its figures replaced, and the figures. Names such as `pid-elbow-up` have none.
fn split(line: &str) -> (String, Vec<f64>) {
    let (mut words, mut figures, mut figure) = (String::new(), Vec::new(), String::new());
    // The last character ends a figure at the end of the line.
    for character in line.chars().chain(['\n']) {
        let continues = matches!(character, ',' | '.') && !figure.is_empty();
        if character.is_ascii_digit() || continues {
            figure.push(character);
            continue;
        }
        if let Ok(value) = figure.replace(',', "").parse() {
            figures.push(value);
            words.push('#');
        }
        figure.clear();
        words.push(character);
    }
    (words, figures)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_may_differ_a_little_but_limits_and_words_may_not() {
        let compare = |present, expected| compare(present, expected, LastFigure::Limit);
        assert_eq!(
            compare("| edge | 1,700 | 2,000 |", "| edge | 1,720 | 2,000 |"),
            Ok(())
        );
        for other in [
            "| edge | 1,600 | 2,000 |",
            "| edge | 1,720 | 2,001 |",
            "| hedge | 1,720 | 2,000 |",
            "| edge | 1,720 |",
            "| edge | 1,720 | 2,000 |\n",
        ] {
            let expected = "| edge | 1,720 | 2,000 |";
            assert_eq!(
                compare(other, expected).is_err(),
                other.trim() != expected,
                "{other}"
            );
        }
        assert_eq!(thousands(88_848), "88,848");
        assert_eq!(thousands(123), "123");
    }
}

//! The outcome of a study as JSON, CSV, table and figure.

use comfy_table::Table;
use serde::Serialize;

/// The outcome of a study. Serialised it is the JSON object of `--json`, whose names are
/// a contract: add to them, never rename.
pub trait Outcome: Serialize {
    /// The lines of the CSV file: flat structs, whose field names are the header.
    fn lines(&self) -> impl IntoIterator<Item: Serialize>;

    /// The outcome as a table, with the paper's values beside.
    fn table(&self) -> Table;
}

/// An outcome that can be drawn.
pub trait Figure {
    /// The figure as SVG text.
    fn svg(&self) -> String;
}

/// The CSV file of an outcome, header included.
///
/// # Errors
/// If the lines cannot be written as CSV, which flat structs can.
pub fn csv(outcome: &impl Outcome) -> Result<Vec<u8>, csv::Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for line in outcome.lines() {
        writer.serialize(line)?;
    }
    writer
        .into_inner()
        .map_err(|error| csv::Error::from(error.into_error()))
}

pub use painleve_process::terminal::table;

/// Returns a text as one word of a shell, in quotes if it needs them.
pub fn quoted(text: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,@%+".contains(c);
    if !text.is_empty() && text.chars().all(is_plain) {
        return text.to_owned();
    }
    // A single quote ends the shell's quotation.
    format!("'{}'", text.replace('\'', "'\\''"))
}

/// The name under which a value is serialised.
pub fn name(value: &impl Serialize) -> String {
    match serde_json::to_value(value) {
        Ok(serde_json::Value::String(name)) => name,
        other => format!("{other:?}"),
    }
}

#[cfg(test)]
mod tests {
    use super::quoted;

    #[test]
    fn only_what_a_shell_would_read_otherwise_is_quoted() {
        assert_eq!(quoted("out/commissioned.toml"), "out/commissioned.toml");
        assert_eq!(quoted("belt.friction=1.2"), "belt.friction=1.2");
        assert_eq!(quoted("my arm.toml"), "'my arm.toml'");
        assert_eq!(quoted("name=it's"), r"'name=it'\''s'");
        assert_eq!(quoted("$HOME"), "'$HOME'");
        assert_eq!(quoted(""), "''");
    }
}

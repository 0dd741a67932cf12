//! Rows of a study as lines of a table, one row at a time.

use std::collections::BTreeMap;

use csv::ByteRecord;
use serde::Serialize;

use crate::{Study, StudyError};

/// A study whose rows each make lines of its CSV file, so that the file can
/// be assembled from rows computed separately.
pub trait Tabular: Study<Row: Serialize> {
    /// Returns the lines of a row, at least one: flat structs, whose field names are the header. By
    /// default the row itself is its only line.
    fn lines(row: &Self::Row) -> impl IntoIterator<Item: Serialize> {
        [row]
    }

    /// Returns every seed that the rows depend on, by its purpose.
    ///
    /// # Errors
    /// [`StudyError`] if the study is invalid.
    fn seeds(&self) -> Result<BTreeMap<String, u64>, StudyError>;
}

/// Any [`Tabular`] study, with its rows as text.
pub trait Table: Sync {
    /// Returns the number of rows.
    fn len(&self) -> usize;

    /// Whether there are no rows.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the header and the lines of row `index`, less than [`len`](Table::len).
    ///
    /// # Errors
    /// [`StudyError`] if the row cannot be computed.
    fn records(&self, index: usize) -> Result<Records, StudyError>;

    /// Returns every seed that the rows depend on, by its purpose.
    ///
    /// # Errors
    /// [`StudyError`] if the study is invalid.
    fn seeds(&self) -> Result<BTreeMap<String, u64>, StudyError>;
}

/// A row as text.
#[derive(Clone, Debug, PartialEq)]
pub struct Records {
    /// Names of the fields.
    pub header: ByteRecord,
    /// The lines.
    pub lines: Vec<ByteRecord>,
}

impl<S: Tabular> Table for S {
    fn len(&self) -> usize {
        Study::len(self)
    }

    fn records(&self, index: usize) -> Result<Records, StudyError> {
        records(S::lines(&self.row(index)?))
            .map_err(|source| StudyError::Unwritable { index, source })
    }

    fn seeds(&self) -> Result<BTreeMap<String, u64>, StudyError> {
        Tabular::seeds(self)
    }
}

fn records(lines: impl IntoIterator<Item: Serialize>) -> Result<Records, csv::Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for line in lines {
        writer.serialize(line)?;
    }
    let text = writer.into_inner().map_err(|error| error.into_error())?;
    let mut reader = csv::Reader::from_reader(text.as_slice());
    let header = reader.byte_headers()?.clone();
    let lines = reader.byte_records().collect::<Result<_, _>>()?;
    Ok(Records { header, lines })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Serialize)]
    struct Line {
        name: &'static str,
        length_m: Option<f64>,
    }

    #[test]
    fn text_round_trips_through_csv() {
        let lines = [
            Line {
                name: "a \"b\", c\nd",
                length_m: Some(-0.1),
            },
            Line {
                name: "",
                length_m: None,
            },
        ];
        let records = records(&lines).unwrap();
        assert_eq!(records.header, vec!["name", "length_m"]);
        assert_eq!(records.lines[0], vec!["a \"b\", c\nd", "-0.1"]);
        assert_eq!(records.lines[1], vec!["", ""]);
    }
}

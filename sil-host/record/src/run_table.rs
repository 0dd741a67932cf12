//! The ticks of a run as columns of numbers, read from a record or from its table.

use std::borrow::Cow;
use std::io::Read;

use serde::Deserialize;

use crate::csv_table::TableReader;
use crate::export::{ExportError, read_as_table};

/// Name of the column of times.
const TIME: &str = "time_s";
/// Most ticks of a run that is held in memory: some hundred megabytes.
pub const MOST_TICKS: usize = 2_000_000;

/// Why a table cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// The record cannot be read.
    #[error(transparent)]
    Record(#[from] ExportError),
    /// The file cannot be read, or is no table.
    #[error("{}{source}", .source.position().map_or_else(String::new, |at| format!("line {}: ", at.line())))]
    Csv {
        /// The reason.
        source: csv::Error,
    },
    /// A column is missing.
    #[error(
        "it has no column {0}: this is not a table of a run's ticks, as `painleve export --csv` writes"
    )]
    NoColumn(&'static str),
    /// A cell of a column of numbers is none.
    #[error("{place}, {column} = '{cell}' is not a number")]
    NotANumber {
        /// Line of the file, or time in the record.
        place: String,
        /// The column.
        column: &'static str,
        /// What is there.
        cell: String,
    },
    /// There is only a header.
    #[error("it has no rows, only the names of its columns")]
    NoRows,
    /// Times do not increase.
    #[error("{0}: the time is not later than the one before")]
    Order(String),
    /// The run is too long.
    #[error(
        "it has more than {MOST_TICKS} ticks or lift-offs, the most that is compared: record shorter runs"
    )]
    TooLong,
}

/// The ticks of a run. A number that is unknown is NaN.
#[derive(Clone, Debug, Default)]
pub struct RunTable {
    /// Simulated or measured time, s, increasing.
    pub time_s: Vec<f64>,
    /// Exact times of the lift-offs, s, from a record's events; `None` of a table, which has only ticks.
    pub(crate) lift_offs_s: Option<Vec<f64>>,
    /// The columns that were asked for, in their order.
    columns: Vec<Vec<f64>>,
    names: Vec<&'static str>,
}

/// What is read of an event.
#[derive(Deserialize)]
struct EventTime<'a> {
    time_s: f64,
    #[serde(borrow)]
    kind: Cow<'a, str>,
}

impl RunTable {
    /// Reads the named columns of a record, and its lift-offs.
    ///
    /// # Errors
    /// [`TableError`] if it is damaged or has no ticks.
    pub fn of_record(record: impl Read + Send, names: &[&'static str]) -> Result<Self, TableError> {
        let mut lift_offs_s = Vec::new();
        let event = |json: &[u8]| {
            let event: EventTime<'_> = serde_json::from_slice(json)?;
            if event.kind == "lift-off" && lift_offs_s.len() <= MOST_TICKS {
                lift_offs_s.push(event.time_s);
            }
            Ok(())
        };
        let table = read_as_table(record, event, |table| Self::read(table, names, true))?;
        if lift_offs_s.len() > MOST_TICKS {
            return Err(TableError::TooLong);
        }
        Ok(Self {
            lift_offs_s: Some(lift_offs_s),
            ..table?
        })
    }

    /// Reads the named columns of a table. One that the table lacks is unknown.
    ///
    /// # Errors
    /// [`TableError`] if it is no table of a run's ticks.
    pub fn of_csv(table: impl Read, names: &[&'static str]) -> Result<Self, TableError> {
        Self::read(table, names, false)
    }

    /// Reads the named columns of a table, of which the user knows the lines, or the times if it is `of_record`.
    fn read(table: impl Read, names: &[&'static str], of_record: bool) -> Result<Self, TableError> {
        let wrong = |source| TableError::Csv { source };
        let mut reader = TableReader::new(table);
        let header = reader.header().map_err(wrong)?;
        let place = |name: &str| header.iter().position(|column| column == name);
        let time = place(TIME).ok_or(TableError::NoColumn(TIME))?;
        let places: Vec<Option<usize>> = names.iter().map(|name| place(name)).collect();
        if places.iter().all(Option::is_none) {
            return Err(TableError::NoColumn("plant.tip_t_m"));
        }
        let mut read = Self {
            time_s: Vec::new(),
            lift_offs_s: None,
            columns: vec![Vec::new(); names.len()],
            names: names.to_vec(),
        };
        let mut row = csv::StringRecord::new();
        while reader.read(&mut row).map_err(wrong)? {
            let place = |when: &str, time_s: f64| match row.position() {
                Some(position) if !of_record => format!("line {}", position.line()),
                _ => format!("{when} {time_s} s"),
            };
            let value = |column, at, time_s| {
                number(&row, at).map_err(|cell| TableError::NotANumber {
                    place: place("at", time_s),
                    column,
                    cell,
                })
            };
            let time_s = value(TIME, Some(time), f64::NAN)?;
            let last_s = read.time_s.last().copied();
            let is_later = last_s.is_none_or(|last_s| time_s > last_s);
            if !is_later || !time_s.is_finite() {
                let place = place("after", last_s.unwrap_or_default());
                return Err(TableError::Order(place));
            }
            if read.time_s.len() >= MOST_TICKS {
                return Err(TableError::TooLong);
            }
            read.time_s.push(time_s);
            for ((column, name), place) in read.columns.iter_mut().zip(names).zip(&places) {
                column.push(value(name, *place, time_s)?);
            }
        }
        if read.time_s.is_empty() {
            return Err(TableError::NoRows);
        }
        Ok(read)
    }

    /// Returns a column; empty if it was not asked for.
    pub fn column(&self, name: &str) -> &[f64] {
        let place = self.names.iter().position(|column| *column == name);
        place.map_or(&[], |place| &self.columns[place])
    }

    /// Returns the changes of a column: time, s, the value before and the value since.
    pub fn changes(&self, name: &str) -> impl Iterator<Item = (f64, f64, f64)> + '_ {
        let pairs = self.column(name).windows(2);
        let times = self.time_s.iter().skip(1);
        pairs.zip(times).filter_map(|(pair, time_s)| {
            (pair[0] != pair[1]).then_some((*time_s, pair[0], pair[1]))
        })
    }

    /// Whether any value of a column is known.
    pub fn knows(&self, name: &str) -> bool {
        self.column(name).iter().any(|value| value.is_finite())
    }

    /// Returns the value of a column at a time, s, interpolated between ticks; NaN outside the run.
    pub fn at(&self, column: &[f64], time_s: f64) -> f64 {
        let after = self.time_s.partition_point(|tick_s| *tick_s < time_s);
        let known = |number: usize| Some((*self.time_s.get(number)?, *column.get(number)?));
        match (after.checked_sub(1).and_then(known), known(after)) {
            (_, Some((exact_s, value))) if exact_s == time_s => value,
            (Some((from_s, from)), Some((to_s, to))) => {
                from + (to - from) * (time_s - from_s) / (to_s - from_s)
            }
            _ => f64::NAN,
        }
    }
}

/// Reads a cell: a number, or true or false as 1 or 0; NaN if it is empty or the table lacks the column. Returns a cell
/// of something else.
fn number(row: &csv::StringRecord, place: Option<usize>) -> Result<f64, String> {
    let cell = place.and_then(|place| row.get(place)).unwrap_or_default();
    match cell.trim() {
        "" => Ok(f64::NAN),
        // Python writes them with a capital.
        "true" | "True" => Ok(1.0),
        "false" | "False" => Ok(0.0),
        text => text.parse().map_err(|_| cell.into()),
    }
}

#[cfg(test)]
mod tests {
    use std::io;

    use super::*;
    use crate::mcap_log::tests::of_messages;

    const NAMES: [&str; 2] = ["plant.tip_t_m", "estimates.contact"];

    fn read(text: &str) -> Result<RunTable, TableError> {
        RunTable::of_csv(text.as_bytes(), &NAMES)
    }

    #[test]
    fn cells_are_numbers_truths_or_unknown() {
        let table = read(
            "time_s,x,plant.tip_t_m,estimates.contact\n0,a,0.1,true\n0.5,b,,False\n1,c, nan ,\n",
        );
        let table = table.unwrap();
        assert_eq!(table.time_s, [0.0, 0.5, 1.0]);
        let contact = table.column("estimates.contact");
        assert_eq!(contact[..2], [1.0, 0.0]);
        assert!(contact[2].is_nan() && table.column("plant.tip_t_m")[1].is_nan());
        assert!((table.at(contact, 0.25) - 0.5).abs() < 1e-12);
        assert_eq!(table.at(contact, 0.5), 0.0);
        assert!(table.at(contact, -0.1).is_nan() && table.at(contact, 1.1).is_nan());
    }

    #[test]
    fn a_place_in_a_record_is_a_time() {
        for (second, message) in [
            (
                (1_000_000_000, "{}"),
                "after 1.5 s: the time is not later than the one before",
            ),
            (
                (2_000_000_000, r#"{"tip_t_m":"hello"}"#),
                "at 2 s, plant.tip_t_m = 'hello' is not a number",
            ),
        ] {
            let record = of_messages("/plant", &[(1_500_000_000, "{}"), second]);
            let error = RunTable::of_record(&record[..], &NAMES).unwrap_err();
            assert_eq!(error.to_string(), message);
        }
    }

    #[test]
    fn whatever_takes_the_place_of_a_row_is_not_held_in_memory() {
        for (start, byte) in [
            ("", b'1'),
            ("time_s,plant.tip_t_m\n0,", b'1'),
            ("time_s,plant.tip_t_m\n0,\"", b'\n'),
        ] {
            let table = start.as_bytes().chain(io::repeat(byte).take(1 << 20));
            let error = RunTable::of_csv(table, &NAMES).unwrap_err();
            assert_eq!(error.to_string(), "a row has more than 65536 bytes");
        }
    }

    #[test]
    fn what_is_no_table_is_refused() {
        for (text, part) in [
            ("a,b\n1,2\n", "no column time_s"),
            ("time_s,b\n1,2\n", "no column plant.tip_t_m"),
            ("time_s,plant.tip_t_m\n", "it has no rows"),
            (
                "time_s,plant.tip_t_m\n0,0.1\n1,hello\n",
                "line 3, plant.tip_t_m = 'hello' is not a number",
            ),
            (
                "time_s,plant.tip_t_m\nsoon,1\n",
                "line 2, time_s = 'soon' is not a number",
            ),
            (
                "time_s,plant.tip_t_m\n1,2\n1,3\n",
                "line 3: the time is not later",
            ),
            ("time_s,plant.tip_t_m\n1,2,3\n", "line 2"),
        ] {
            let message = read(text).unwrap_err().to_string();
            assert!(message.contains(part), "{part}: {message}");
        }
    }
}

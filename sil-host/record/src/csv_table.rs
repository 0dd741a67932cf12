//! A run as a CSV file: one row per control tick, one column per quantity.
//!
//! The first column is `time_s`; the others are named by topic and field of the MCAP file, for
//! example `plant.tip_t_m`. A cell is empty if its quantity is not finite or unknown.

use std::io;
use std::path::PathBuf;

use csv::StringRecord;
use painleve_files::atomic_file::AtomicFile;

use crate::fields::{Read, TOPICS};
use crate::messages::nanoseconds;
use crate::recorder::{RecordError, RecordedTick, Sink};

/// Returns the header of the table.
pub fn header() -> Vec<String> {
    let columns = TOPICS.iter().flat_map(|topic| {
        let name = |field: &crate::fields::RecordField| format!("{}.{}", topic.name, field.name);
        topic.fields.iter().map(name)
    });
    std::iter::once("time_s".to_owned())
        .chain(columns)
        .collect()
}

/// Returns the row of a tick.
pub fn row(tick: &RecordedTick<'_>) -> Vec<String> {
    let mut row = vec![time(nanoseconds(tick.sample.plant.time_s))];
    for topic in TOPICS {
        let known = tick.estimates.is_some() || !topic.needs_estimates;
        row.extend(topic.fields.iter().map(|field| match field.read {
            _ if !known => String::new(),
            Read::Number(read) => decimal(read(tick)),
            Read::Single(read) => decimal(read(tick)),
            Read::Whole(read) => read(tick).to_string(),
            Read::Text(read) => read(tick).to_owned(),
            Read::Truth(read) => read(tick).to_string(),
        }));
    }
    row
}

/// Returns the cell of a time: s to the nanosecond, as in a record.
pub(crate) fn time(time_ns: u64) -> String {
    decimal(time_ns as f64 / 1e9)
}

/// Returns the shortest decimal that gives the same number; an empty string if it is not finite.
pub(crate) fn decimal(value: impl serde::Serialize) -> String {
    match serde_json::to_string(&value) {
        Ok(text) if text != "null" => text,
        _ => String::new(),
    }
}

/// Longest row of a table that is read, bytes. Those of a run have a thousand.
const LONGEST_ROW: u64 = 1 << 16;

/// Reads a table, which may come from anywhere: nothing longer than [`LONGEST_ROW`] is held.
pub struct TableReader<R>(csv::Reader<io::Take<R>>);

impl<R: io::Read> TableReader<R> {
    /// Reads nothing yet.
    pub fn new(table: R) -> Self {
        Self(csv::Reader::from_reader(table.take(LONGEST_ROW)))
    }

    /// Returns the names of the columns.
    ///
    /// # Errors
    /// [`csv::Error`] if they cannot be read.
    pub fn header(&mut self) -> csv::Result<StringRecord> {
        let header = self.0.headers().cloned();
        self.bounded(header)
    }

    /// Reads the next row; `false` at the end.
    ///
    /// # Errors
    /// [`csv::Error`] if it cannot be read.
    pub fn read(&mut self, row: &mut StringRecord) -> csv::Result<bool> {
        let read = self.0.read_record(row);
        self.bounded(read)
    }

    /// Refuses what was read if it ended at the limit, and sets the limit for the next row.
    fn bounded<T>(&mut self, read: csv::Result<T>) -> csv::Result<T> {
        let table = self.0.get_mut();
        if table.limit() == 0 {
            let reason = format!("a row has more than {LONGEST_ROW} bytes");
            return Err(io::Error::new(io::ErrorKind::InvalidData, reason).into());
        }
        table.set_limit(LONGEST_ROW);
        read
    }
}

/// Writes a run to a CSV file that appears once it is complete.
pub struct CsvTable {
    path: PathBuf,
    writer: csv::Writer<AtomicFile>,
}

impl CsvTable {
    /// Writes to a file that has been created.
    ///
    /// # Errors
    /// [`RecordError`] if it cannot be written.
    pub fn to(file: AtomicFile) -> Result<Self, RecordError> {
        let mut table = Self {
            path: file.path().to_path_buf(),
            writer: csv::Writer::from_writer(file),
        };
        table.write(header())?;
        Ok(table)
    }

    fn write(&mut self, row: Vec<String>) -> Result<(), RecordError> {
        self.writer
            .write_record(row)
            .map_err(|error| RecordError::write(&self.path, error.into()))
    }

    fn complete(self) -> Result<AtomicFile, RecordError> {
        self.writer
            .into_inner()
            .map_err(|error| RecordError::write(&self.path, error.into_error()))
    }
}

impl Sink for CsvTable {
    fn tick(&mut self, tick: &RecordedTick<'_>) -> Result<(), RecordError> {
        self.write(row(tick))
    }

    fn finish(self: Box<Self>) -> Result<Option<AtomicFile>, RecordError> {
        Ok(Some(self.complete()?))
    }

    fn finish_partial(self: Box<Self>, _reason: &str) -> Result<Option<PathBuf>, RecordError> {
        Ok(Some(self.complete()?.commit_partial()?))
    }
}

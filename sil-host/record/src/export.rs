//! Columns of a recorded MCAP file as CSV text.

use std::borrow::Cow;
use std::fmt;
use std::io::{self, PipeReader, Read, Write};
use std::thread;

use serde::de::{DeserializeSeed, Deserializer, IgnoredAny, MapAccess, Visitor};
use serde_json::value::RawValue;

use crate::csv_table::{header, time};
use crate::fields::{TOPICS, Topic};
use crate::messages::EVENTS;
use crate::record_file::{Damage, Extent, RecordedMessage, messages};

/// Why a record cannot be exported.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The file was made from a record and does not hold all of it.
    #[error("this is a ROS 2 bag: export the record from which it was made")]
    Bag,
    /// The record is damaged, and nothing is exported.
    #[error("not a complete MCAP file, and no tick in it is intact: {0}")]
    Incomplete(#[source] Damage),
    /// The record is damaged behind whole ticks.
    #[error(
        "it is damaged after {whole_bytes} bytes: {reason}; painleve export --csv --recover exports the {rows} ticks \
         before, up to {end_s} s"
    )]
    Damaged {
        /// What is wrong.
        reason: Damage,
        /// Bytes before the damage.
        whole_bytes: u64,
        /// Whole ticks.
        rows: u64,
        /// Time of the last of them, s.
        end_s: f64,
    },
    /// The file has no topic with one message per tick.
    #[error("no topic /plant, /sensor, /actuator or /estimates: this is not a record of painleve")]
    NoTicks,
    /// A time is later than a bag can hold.
    #[error("a wall-clock time is later than January 2038, the end of the times of ROS 2")]
    Late,
    /// What is exported cannot be written.
    #[error(transparent)]
    Write(#[from] csv::Error),
}

impl From<Damage> for ExportError {
    fn from(damage: Damage) -> Self {
        match damage {
            Damage::Bag => Self::Bag,
            damage => Self::Incomplete(damage),
        }
    }
}

/// What was exported.
#[derive(Debug)]
pub struct Exported {
    /// Number of ticks.
    pub rows: u64,
    /// Time of the last one, s.
    pub end_s: f64,
    /// What ended the record before its end, if it is damaged.
    pub damage: Option<Damage>,
    /// Bytes of the record before the damage.
    pub whole_bytes: u64,
}

impl Exported {
    /// Refuses what is not the whole record.
    ///
    /// # Errors
    /// [`ExportError::Damaged`].
    pub fn whole(self) -> Result<Self, ExportError> {
        match self {
            Self {
                damage: Some(reason),
                whole_bytes,
                rows,
                end_s,
            } => Err(ExportError::Damaged {
                reason,
                whole_bytes,
                rows,
                end_s,
            }),
            whole => Ok(whole),
        }
    }
}

/// Writes the ticks of a record as CSV, with the columns of [`csv_table`](crate::csv_table). Of a damaged record the
/// ticks before the damage are written, checked and whole: see [`Exported::damage`].
///
/// # Errors
/// [`ExportError`] if there is not even one, or the rows cannot be written.
pub fn ticks_to_csv(record: impl Read, output: impl Write) -> Result<Exported, ExportError> {
    ticks_and_events(record, output, |_| Ok(()))
}

/// Passes the table of a whole record on while it is written, so that memory does not grow with it, and the JSON of every
/// event.
///
/// # Errors
/// [`ExportError`] if the record is damaged, has no ticks or is not read to its end; what `read` refuses is its own error.
pub fn read_as_table<T, E>(
    record: impl Read + Send,
    event: impl FnMut(&[u8]) -> serde_json::Result<()> + Send,
    read: impl FnOnce(PipeReader) -> Result<T, E>,
) -> Result<Result<T, E>, ExportError> {
    let (reader, writer) = io::pipe().map_err(csv::Error::from)?;
    thread::scope(|scope| {
        let exported =
            scope.spawn(move || ticks_and_events(record, io::BufWriter::new(writer), event));
        // Owned, so that a table that is refused closes the pipe.
        let table = read(reader);
        match exported.join() {
            Ok(Ok(exported)) => exported.whole().map(|_| table),
            // Why it was refused says more than the broken pipe.
            Ok(Err(ExportError::Write(_))) if table.is_err() => Ok(table),
            Ok(Err(error)) => Err(error),
            Err(panic) => std::panic::resume_unwind(panic),
        }
    })
}

/// As [`ticks_to_csv`]; passes the JSON of every event on.
fn ticks_and_events(
    record: impl Read,
    output: impl Write,
    mut event: impl FnMut(&[u8]) -> serde_json::Result<()>,
) -> Result<Exported, ExportError> {
    let mut rows = Rows {
        writer: csv::Writer::from_writer(output),
        row: Row::default(),
        written: 0,
        end_ns: 0,
        topics: None,
    };
    rows.writer.write_record(header())?;
    let mut extent = Extent::default();
    let read = messages(record, &mut extent, |message| match message.topic {
        EVENTS => event(message.json).map_err(|source| {
            let topic = "events";
            Damage::Message { topic, source }.into()
        }),
        _ => rows.take_in(message),
    });
    let damage = match read {
        Ok(()) => None,
        Err(Stop::Damage(damage)) => Some(damage),
        Err(Stop::Write(error)) => return Err(error.into()),
    };
    // The messages of one tick may be in two chunks.
    if damage.is_none() || rows.topics == Some(rows.row.topics()) {
        rows.end_row()?;
    }
    if rows.written == 0 {
        return Err(damage.map_or(ExportError::NoTicks, ExportError::from));
    }
    rows.writer.flush().map_err(csv::Error::from)?;
    Ok(Exported {
        rows: rows.written,
        end_s: rows.end_ns as f64 / 1e9,
        damage,
        whole_bytes: extent.whole_bytes,
    })
}

/// What ends the reading of a record.
enum Stop {
    Damage(Damage),
    Write(csv::Error),
}

impl From<Damage> for Stop {
    fn from(damage: Damage) -> Self {
        Self::Damage(damage)
    }
}

/// The rows of the table.
struct Rows<W: Write> {
    writer: csv::Writer<W>,
    /// The row to which messages are added.
    row: Row,
    written: u64,
    /// Time of the last row written.
    end_ns: u64,
    /// Topics of the last row written.
    topics: Option<[bool; TOPICS.len()]>,
}

impl<W: Write> Rows<W> {
    fn take_in(&mut self, message: RecordedMessage<'_>) -> Result<(), Stop> {
        let topic = &TOPICS[message.topic];
        let mut json = serde_json::Deserializer::from_slice(message.json);
        let cells = Cells(topic)
            .deserialize(&mut json)
            .and_then(|cells| json.end().map(|()| cells))
            .map_err(|source| Damage::Message {
                topic: topic.name,
                source,
            })?;
        if self.row.time_ns != Some(message.time_ns) {
            self.end_row().map_err(Stop::Write)?;
            self.row.time_ns = Some(message.time_ns);
        }
        self.row.cells[message.topic] = Some(cells);
        Ok(())
    }

    /// Writes the row, if there is one, and begins an empty one.
    fn end_row(&mut self) -> Result<(), csv::Error> {
        let row = std::mem::take(&mut self.row);
        let Some(time_ns) = row.time_ns else {
            return Ok(());
        };
        self.topics = Some(row.topics());
        self.end_ns = time_ns;
        self.written += 1;
        let cells = TOPICS.iter().zip(row.cells).flat_map(|(topic, cells)| {
            cells.unwrap_or_else(|| vec![String::new(); topic.fields.len()])
        });
        self.writer
            .write_record(std::iter::once(time(time_ns)).chain(cells))
    }
}

/// The messages of one tick.
#[derive(Default)]
struct Row {
    time_ns: Option<u64>,
    /// The cells of each topic that has a message.
    cells: [Option<Vec<String>>; TOPICS.len()],
}

impl Row {
    /// Returns which topics have a message.
    fn topics(&self) -> [bool; TOPICS.len()] {
        self.cells.each_ref().map(Option::is_some)
    }
}

/// Reads the cells of a topic from its message: numbers as they are written there, strings without quotes.
struct Cells(&'static Topic);

impl<'de> DeserializeSeed<'de> for Cells {
    type Value = Vec<String>;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Self::Value, D::Error> {
        deserializer.deserialize_map(self)
    }
}

impl<'de> Visitor<'de> for Cells {
    type Value = Vec<String>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an object")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
        let mut cells = vec![String::new(); self.0.fields.len()];
        while let Some(key) = map.next_key::<Cow<'_, str>>()? {
            match self.0.fields.iter().position(|field| field.name == key) {
                Some(field) => cells[field] = cell(map.next_value::<&RawValue>()?),
                None => {
                    map.next_value::<IgnoredAny>()?;
                }
            }
        }
        Ok(cells)
    }
}

fn cell(value: &RawValue) -> String {
    match value.get() {
        "null" => String::new(),
        text => serde_json::from_str::<String>(text).unwrap_or_else(|_| text.to_owned()),
    }
}

#[cfg(test)]
mod tests;

//! Columns of a recorded MCAP file as CSV text.

use std::collections::BTreeMap;
use std::io::Write;

use mcap::McapError;
use serde_json::value::RawValue;

use crate::csv_table::{decimal, header};
use crate::fields::{TOPICS, Topic};

/// Why a record cannot be exported.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The file is not an MCAP file, or is damaged.
    #[error("not a complete MCAP file: {0}")]
    Mcap(#[from] McapError),
    /// A message is not JSON.
    #[error("a message of topic {topic} cannot be read: {source}")]
    Message {
        /// The topic.
        topic: String,
        /// The reason.
        source: serde_json::Error,
    },
    /// The file has no topic with one message per tick.
    #[error("no topic /plant, /sensor, /actuator or /estimates: this is not a record of painleve")]
    NoTicks,
    /// The rows cannot be written.
    #[error(transparent)]
    Write(#[from] csv::Error),
}

/// Writes the ticks of a record as CSV, with the columns of [`csv_table`](crate::csv_table).
///
/// # Errors
/// [`ExportError`].
pub fn ticks_to_csv(record: &[u8], output: impl Write) -> Result<(), ExportError> {
    let mut writer = csv::Writer::from_writer(output);
    writer.write_record(header())?;
    let mut row = Row::default();
    for message in mcap::MessageStream::new(record)? {
        let message = message?;
        let name = message.channel.topic.trim_start_matches('/');
        let Some(topic) = TOPICS.iter().position(|topic| topic.name == name) else {
            continue;
        };
        if row.time_ns != Some(message.log_time) {
            row.write(&mut writer)?;
            row.time_ns = Some(message.log_time);
        }
        row.topics[topic] =
            serde_json::from_slice(&message.data).map_err(|source| ExportError::Message {
                topic: message.channel.topic.clone(),
                source,
            })?;
    }
    if row.time_ns.is_none() {
        return Err(ExportError::NoTicks);
    }
    row.write(&mut writer)?;
    writer.flush().map_err(csv::Error::from)?;
    Ok(())
}

/// The messages of one tick.
#[derive(Default)]
struct Row {
    time_ns: Option<u64>,
    topics: [BTreeMap<String, Box<RawValue>>; TOPICS.len()],
}

impl Row {
    /// Writes the row, if there is one, and empties it.
    fn write(&mut self, writer: &mut csv::Writer<impl Write>) -> Result<(), csv::Error> {
        let Some(time_ns) = self.time_ns.take() else {
            return Ok(());
        };
        let topics = std::mem::take(&mut self.topics);
        let cells = TOPICS
            .iter()
            .zip(&topics)
            .flat_map(|(topic, values)| cells(topic, values));
        let time = decimal(time_ns as f64 / 1e9);
        writer.write_record(std::iter::once(time).chain(cells))
    }
}

/// Returns the cells of a topic: numbers as they are written in the file, strings without quotes.
fn cells<'a>(
    topic: &'a Topic,
    values: &'a BTreeMap<String, Box<RawValue>>,
) -> impl Iterator<Item = String> + 'a {
    topic.fields.iter().map(|field| {
        let text = values.get(field.name).map_or("", |value| value.get());
        serde_json::from_str::<String>(text).unwrap_or_else(|_| match text {
            "null" => String::new(),
            number => number.to_owned(),
        })
    })
}

//! Reads the messages of a recorded MCAP file.
//!
//! The file may come from anywhere and may be damaged. Every chunk is checked against its checksum before its
//! messages are passed on, every length against the bytes that are there, and nothing longer than
//! [`MOST_BYTES`] is loaded: memory does not grow with the file.

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::io::{self, Read};

use mcap::records::{ChunkHeader, Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{McapError, parse_record};

use crate::fields::TOPICS;
use crate::messages::EVENTS;

/// Longest record, and longest content of a chunk, bytes. Those of a run have 1 MB.
pub const MOST_BYTES: usize = 8 << 20;

/// Name of the metadata in which a run describes itself.
pub const NOTES: &str = "painleve";

/// Profile of the ROS 2 bags that are made from records.
pub(crate) const BAG: &str = "ros2";

/// What is wrong with a record.
#[derive(Debug, thiserror::Error)]
pub enum Damage {
    /// The file cannot be read.
    #[error(transparent)]
    Read(#[from] io::Error),
    /// The file, or a part of it, is not MCAP.
    #[error(transparent)]
    Mcap(#[from] McapError),
    /// The file is MCAP, but not a record.
    #[error("this is a ROS 2 bag: give the record from which it was made")]
    Bag,
    /// A chunk is longer than any chunk of a run.
    #[error("a chunk has {0} bytes, more than {MOST_BYTES}")]
    LongChunk(u64),
    /// A chunk's content cannot be unpacked.
    #[error("a chunk cannot be unpacked: {0}")]
    Packed(io::Error),
    /// A chunk is packed in another way than a run's.
    #[error("a chunk is packed with {0:?} instead of zstd")]
    Compression(String),
    /// The content of a chunk is not what was written.
    #[error("a chunk does not match its checksum")]
    Checksum,
    /// A length does not fit what it measures.
    #[error("the length of a record does not fit its content")]
    Length,
    /// A record is of a kind that no run writes before its end.
    #[error("a record is of the unknown kind {0:#04x}")]
    Kind(u8),
    /// A message belongs to a channel that is not described before it.
    #[error("a message belongs to no channel")]
    NoChannel,
    /// A message is not JSON.
    #[error("a message of topic {topic} cannot be read: {source}")]
    Message {
        /// The topic.
        topic: &'static str,
        /// The reason.
        source: serde_json::Error,
    },
}

/// A message of one of the [`TOPICS`], or an event.
#[derive(Clone, Copy, Debug)]
pub struct RecordedMessage<'a> {
    /// Number of the topic in [`TOPICS`], or [`EVENTS`].
    pub topic: usize,
    /// Time of the message, ns.
    pub time_ns: u64,
    /// The message, JSON.
    pub json: &'a [u8],
}

/// How far a file could be read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Extent {
    /// Bytes before the first damage.
    pub whole_bytes: u64,
}

/// Passes every message of the [`TOPICS`] and every event on, in the order of the file. All messages that were passed on before an
/// error are whole. Reads in small parts: give it a buffered file.
///
/// # Errors
/// [`Damage`], as its own type or that of `receive`.
pub fn messages<E: From<Damage>>(
    file: impl Read,
    extent: &mut Extent,
    mut receive: impl FnMut(RecordedMessage<'_>) -> Result<(), E>,
) -> Result<(), E> {
    let mut channels = Channels::default();
    records(file, extent, |opcode, data| {
        channels.file_record(opcode, data, &mut receive)?;
        Ok(true)
    })
}

/// Returns what a run has noted about itself at the start of its record: `scenario`, `configuration` (TOML), `version`,
/// `source` and more; `None` if there is no such note.
///
/// # Errors
/// [`Damage`] before it.
pub fn notes(file: impl Read) -> Result<Option<BTreeMap<String, String>>, Damage> {
    let mut found = None;
    records(file, &mut Extent::default(), |opcode, data| {
        if opcode == op::METADATA
            && let Record::Metadata(record) = parse_record(opcode, data)?
            && record.name == NOTES
        {
            found = Some(record.metadata);
        }
        // The notes come before all messages.
        Ok::<_, Damage>(found.is_none() && opcode != op::CHUNK)
    })?;
    Ok(found)
}

/// Passes every record before the end of the data on, until `take` wants no more.
fn records<E: From<Damage>>(
    mut file: impl Read,
    extent: &mut Extent,
    mut take: impl FnMut(u8, &[u8]) -> Result<bool, E>,
) -> Result<(), E> {
    let options = LinearReaderOptions::default()
        .with_emit_chunks(true)
        .with_validate_data_section_crc(true)
        .with_validate_summary_section_crc(true)
        .with_check_finishes_after_end_magic(true)
        .with_record_length_limit(MOST_BYTES);
    let mut reader = LinearReader::new_with_options(options);
    let (mut bytes_read, mut is_in_data) = (0, true);
    while let Some(event) = reader.next_event() {
        match event.map_err(Damage::from)? {
            LinearReadEvent::ReadRequest(wanted) => {
                let read = loop {
                    match file.read(reader.insert(wanted)) {
                        Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                        read => break read.map_err(Damage::from)?,
                    }
                };
                reader.notify_read(read);
                bytes_read += read as u64;
            }
            LinearReadEvent::Record { opcode, data } => {
                // Of a damaged head, what follows may still be read.
                if opcode == op::HEADER
                    && let Ok(Record::Header(header)) = parse_record(opcode, data)
                    && header.profile == BAG
                {
                    return Err(Damage::Bag.into());
                }
                // Behind the data, the file repeats what it holds, for readers that seek.
                is_in_data &= opcode != op::DATA_END;
                if is_in_data && !take(opcode, data)? {
                    return Ok(());
                }
                // The reader never asks for more than the next record.
                extent.whole_bytes = bytes_read;
            }
        }
    }
    Ok(())
}

/// The topics of the channels described so far; `None` for those of other topics.
#[derive(Default)]
struct Channels(HashMap<u16, Option<usize>>);

impl Channels {
    /// Takes in a record of the file. Whatever is no record that a run writes has taken the place of one: it is not
    /// skipped.
    fn file_record<E: From<Damage>>(
        &mut self,
        opcode: u8,
        data: &[u8],
        receive: &mut impl FnMut(RecordedMessage<'_>) -> Result<(), E>,
    ) -> Result<(), E> {
        match opcode {
            op::HEADER | op::ATTACHMENT | op::METADATA => Ok(()),
            op::MESSAGE_INDEX => Ok(check_index(data).ok_or(Damage::Length)?),
            op::CHUNK => {
                let content = chunk(data)?;
                let mut rest = content.as_ref();
                while !rest.is_empty() {
                    let (opcode, data, after) = split(rest).ok_or(Damage::Length)?;
                    self.record(opcode, data, receive)?;
                    rest = after;
                }
                Ok(())
            }
            _ => self.record(opcode, data, receive),
        }
    }

    /// Takes in a record that may be in a chunk.
    fn record<E: From<Damage>>(
        &mut self,
        opcode: u8,
        data: &[u8],
        receive: &mut impl FnMut(RecordedMessage<'_>) -> Result<(), E>,
    ) -> Result<(), E> {
        match opcode {
            op::SCHEMA => return Ok(()),
            op::CHANNEL | op::MESSAGE => {}
            _ => return Err(Damage::Kind(opcode).into()),
        }
        match parse_record(opcode, data).map_err(Damage::from)? {
            Record::Channel(channel) => {
                let name = channel.topic.trim_start_matches('/');
                let topic = TOPICS.iter().position(|topic| topic.name == name);
                let events = (name == "events").then_some(EVENTS);
                self.0.insert(channel.id, topic.or(events));
            }
            Record::Message { header, data } => {
                let topic = self.0.get(&header.channel_id).ok_or(Damage::NoChannel)?;
                if let Some(topic) = *topic {
                    receive(RecordedMessage {
                        topic,
                        time_ns: header.log_time,
                        json: &data,
                    })?;
                }
            }
            _ => {}
        }
        Ok(())
    }
}

/// Checks the length of the index after a chunk: a channel's number and a list with its length.
fn check_index(data: &[u8]) -> Option<()> {
    let (_, after) = data.split_first_chunk::<2>()?;
    let (length, list) = after.split_first_chunk()?;
    (u64::from(u32::from_le_bytes(*length)) == list.len() as u64).then_some(())
}

/// Returns the content of a chunk record, checked.
fn chunk(record: &[u8]) -> Result<Cow<'_, [u8]>, Damage> {
    let Record::Chunk { header, data } = parse_record(op::CHUNK, record)? else {
        return Err(Damage::Length);
    };
    // Two times, a size, a checksum, the name of the packer with its length, another size.
    let start = 40 + header.compression.len();
    match (data, record.get(start..)) {
        (Cow::Borrowed(data), Some(rest)) if rest.len() == data.len() => unpacked(&header, data),
        _ => Err(Damage::Length),
    }
}

/// Returns the content of a chunk, checked.
fn unpacked<'a>(header: &ChunkHeader, data: &'a [u8]) -> Result<Cow<'a, [u8]>, Damage> {
    let length = usize::try_from(header.uncompressed_size).unwrap_or(usize::MAX);
    if length > MOST_BYTES {
        return Err(Damage::LongChunk(header.uncompressed_size));
    }
    let content = match header.compression.as_str() {
        "" => Cow::Borrowed(data),
        "zstd" => Cow::Owned(zstd::bulk::decompress(data, length).map_err(Damage::Packed)?),
        other => return Err(Damage::Compression(other.to_owned())),
    };
    // 0 stands for no checksum.
    let checksum = header.uncompressed_crc;
    let is_intact = || checksum == 0 || crc32fast::hash(&content) == checksum;
    if content.len() == length && is_intact() {
        Ok(content)
    } else {
        Err(Damage::Checksum)
    }
}

/// Returns the first record of a chunk, its kind and content, and the bytes after it.
fn split(bytes: &[u8]) -> Option<(u8, &[u8], &[u8])> {
    let (&opcode, bytes) = bytes.split_first()?;
    let (length, bytes) = bytes.split_first_chunk()?;
    let length = usize::try_from(u64::from_le_bytes(*length)).ok()?;
    let (data, after) = bytes.split_at_checked(length)?;
    Some((opcode, data, after))
}

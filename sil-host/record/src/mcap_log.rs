//! A run as an MCAP log: JSON messages with their schemas, in zstd chunks.
//!
//! [`messages`](crate::messages) describes the topics; `log_time` is simulated time. One metadata
//! record holds the scenario, and the time by the clock at which the record began.

use std::collections::BTreeMap;
use std::io::{self, BufWriter, Write as _};
use std::path::PathBuf;
use std::time::SystemTime;

use mcap::McapError;
use mcap::records::{MessageHeader, Metadata};
use painleve_files::atomic_file::AtomicFile;
use painleve_plant::scenario::Scenario;
use serde::Serialize;

use crate::events::RunEvent;
use crate::fields::TOPICS;
use crate::messages::{
    CHANNELS, EVENTS, SCENE, TRANSFORMS, TickMessage, channels, event_message, nanoseconds,
};
use crate::record_file::NOTES;
use crate::recorder::{RecordError, RecordedTick, Sink};
use crate::scene::Scene;

/// Source of the recorded run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// A simulated arm.
    Simulation,
    /// A real arm; quantities without a sensor are left out.
    Arm,
}

impl Source {
    /// Returns the name in the metadata.
    pub fn name(self) -> &'static str {
        match self {
            Self::Simulation => "simulation",
            Self::Arm => "arm",
        }
    }
}

/// Writes a run to an MCAP file that appears once it is complete.
pub struct McapLog {
    path: PathBuf,
    writer: mcap::Writer<BufWriter<AtomicFile>>,
    /// Numbers of the [`channels`] in the file.
    channels: [u16; CHANNELS],
    picture: Scene,
    sequence: u32,
    event_sequence: u32,
    json: Vec<u8>,
}

impl McapLog {
    /// Creates the file of a run of this scenario.
    ///
    /// # Errors
    /// [`RecordError`] if the file or its folder cannot be created.
    pub fn create(
        path: impl Into<PathBuf>,
        scenario: &Scenario,
        source: Source,
    ) -> Result<Self, RecordError> {
        Self::to(AtomicFile::create(path)?, scenario, source)
    }

    /// Writes to a file that has been created.
    ///
    /// # Errors
    /// [`RecordError`] if it cannot be written.
    pub fn to(file: AtomicFile, scenario: &Scenario, source: Source) -> Result<Self, RecordError> {
        let path = file.path().to_path_buf();
        Self::begin(path.clone(), file, scenario, source)
            .map_err(|error| RecordError::write(&path, reason(error)))
    }

    fn begin(
        path: PathBuf,
        file: AtomicFile,
        scenario: &Scenario,
        source: Source,
    ) -> Result<Self, McapError> {
        let mut writer = mcap::WriteOptions::new()
            .profile(NOTES)
            .library(concat!("painleve ", env!("CARGO_PKG_VERSION")))
            // The cores belong to the control loop; one thread is fast enough.
            .compression_threads(0)
            // The default level is slower here and compresses these messages no better.
            .compression_level(1)
            .create(BufWriter::new(file))?;
        let configuration = scenario.to_toml().map_err(io::Error::other)?;
        writer.write_metadata(&Metadata {
            name: NOTES.to_owned(),
            metadata: BTreeMap::from([
                ("scenario".into(), scenario.name.clone()),
                ("configuration".into(), configuration),
                ("version".into(), env!("CARGO_PKG_VERSION").into()),
                ("source".into(), source.name().into()),
                ("start_unix_ns".into(), unix_ns().to_string()),
            ]),
        })?;
        let mut numbers = [0; CHANNELS];
        for (number, channel) in numbers.iter_mut().zip(channels()) {
            let schema = channel.schema.as_bytes();
            let schema = writer.add_schema(channel.schema_name, "jsonschema", schema)?;
            *number = writer.add_channel(schema, &channel.topic, "json", &BTreeMap::new())?;
        }
        Ok(Self {
            path,
            channels: numbers,
            writer,
            picture: Scene::new(scenario),
            sequence: 0,
            event_sequence: 0,
            json: Vec::with_capacity(4096),
        })
    }

    fn write_tick(&mut self, tick: &RecordedTick<'_>) -> Result<(), McapError> {
        let time_ns = nanoseconds(tick.sample.plant.time_s);
        let sequence = self.sequence;
        for (channel, topic) in TOPICS.into_iter().enumerate() {
            if tick.estimates.is_some() || !topic.needs_estimates {
                let message = TickMessage { topic, tick };
                self.write_message(channel, sequence, time_ns, &message)?;
            }
        }
        if let Some(picture) = self.picture.tick(tick) {
            self.write_message(TRANSFORMS, sequence, time_ns, &picture.transforms)?;
            self.write_message(SCENE, sequence, time_ns, &picture.scene)?;
        }
        self.sequence = sequence.wrapping_add(1);
        Ok(())
    }

    fn write_message(
        &mut self,
        channel: usize,
        sequence: u32,
        time_ns: u64,
        message: &impl Serialize,
    ) -> Result<(), McapError> {
        self.json.clear();
        serde_json::to_writer(&mut self.json, message).map_err(io::Error::from)?;
        let header = MessageHeader {
            channel_id: self.channels[channel],
            sequence,
            log_time: time_ns,
            publish_time: time_ns,
        };
        self.writer.write_to_known_channel(&header, &self.json)
    }

    /// Completes the file, or tells why it is not complete.
    fn close(mut self) -> (AtomicFile, Result<(), RecordError>) {
        let finished = self.writer.finish();
        let mut buffered = self.writer.into_inner();
        let closed = finished.and_then(|_| Ok(buffered.flush()?));
        let closed = closed.map_err(|error| RecordError::write(&self.path, reason(error)));
        (buffered.into_parts().0, closed)
    }
}

impl Sink for McapLog {
    fn tick(&mut self, tick: &RecordedTick<'_>) -> Result<(), RecordError> {
        self.write_tick(tick)
            .map_err(|error| RecordError::write(&self.path, reason(error)))
    }

    fn event(&mut self, event: &RunEvent) -> Result<(), RecordError> {
        let sequence = self.event_sequence;
        self.event_sequence = sequence.wrapping_add(1);
        let time_ns = nanoseconds(event.time_s);
        self.write_message(EVENTS, sequence, time_ns, &event_message(event))
            .map_err(|error| RecordError::write(&self.path, reason(error)))
    }

    fn finish(self: Box<Self>) -> Result<Option<AtomicFile>, RecordError> {
        let (file, closed) = self.close();
        match closed {
            Ok(()) => Ok(Some(file)),
            Err(error) => match file.commit_partial() {
                Ok(path) => Err(error.but_partly_in(path)),
                Err(_) => Err(error),
            },
        }
    }

    /// Writes the reason to a metadata record `ended early`.
    fn finish_partial(
        mut self: Box<Self>,
        reason_text: &str,
    ) -> Result<Option<PathBuf>, RecordError> {
        let metadata = Metadata {
            name: "ended early".to_owned(),
            metadata: BTreeMap::from([("reason".to_owned(), reason_text.to_owned())]),
        };
        let noted = self.writer.write_metadata(&metadata);
        let noted = noted.map_err(|error| RecordError::write(&self.path, reason(error)));
        let (file, closed) = self.close();
        // What a full disk does not take is left out: `export --recover` reads the rest.
        let path = file.commit_partial()?;
        match noted.and(closed) {
            Ok(()) => Ok(Some(path)),
            Err(error) => Err(error.but_partly_in(path)),
        }
    }
}

/// Returns the time by the clock, ns since 1970; 0 if the clock is before.
#[expect(
    clippy::disallowed_methods,
    reason = "a note about the run, on which no result depends"
)]
fn unix_ns() -> u128 {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    now.map_or(0, |since| since.as_nanos())
}

pub(crate) fn reason(error: McapError) -> io::Error {
    match error {
        McapError::Io(error) => error,
        other => io::Error::other(other),
    }
}

#[cfg(test)]
pub(crate) mod tests;

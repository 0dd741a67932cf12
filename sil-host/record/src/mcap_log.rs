//! A run as an MCAP log: JSON messages with their schemas, in zstd chunks.
//!
//! Topics; `log_time` is simulated time:
//! - `/plant`, `/sensor`, `/actuator`, `/estimates`: one message per control tick, [`fields`](crate::fields)
//! - `/events`: impacts, changes of mode and state, faults, [`events`](crate::events)
//! - `/tf`, `/scene`: the arm for Foxglove's 3-D panel, 60 times a second, [`scene`](crate::scene)
//!
//! Messages per tick are flat, so every number is a curve in Foxglove and PlotJuggler. A value that
//! is not finite is left out. One metadata record holds the scenario.

use std::collections::BTreeMap;
use std::io::{self, BufWriter};
use std::path::PathBuf;

use mcap::McapError;
use mcap::records::{MessageHeader, Metadata};
use painleve_plant::Event;
use painleve_plant::scenario::Scenario;
use painleve_system::atomic_file::AtomicFile;
use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};
use serde_json::{Value, json};

use crate::events::{EventKind, RunEvent};
use crate::fields::{Read, TOPICS, Topic};
use crate::recorder::{RecordError, RecordedTick, Sink};
use crate::scene::Scene;

/// Foxglove's published schemas; see `foxglove/README.md`.
const FRAME_TRANSFORMS: &str = include_str!("foxglove/FrameTransforms.json");
const SCENE_UPDATE: &str = include_str!("foxglove/SceneUpdate.json");

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
    /// Channels of [`TOPICS`], in their order.
    topics: [u16; TOPICS.len()],
    events: u16,
    transforms: u16,
    scene: u16,
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
            .library(concat!("painleve ", env!("CARGO_PKG_VERSION")))
            // The cores belong to the control loop; one thread is fast enough.
            .compression_threads(0)
            // The default level is slower here and compresses these messages no better.
            .compression_level(1)
            .create(BufWriter::new(file))?;
        let configuration = toml::to_string(scenario).map_err(io::Error::other)?;
        writer.write_metadata(&Metadata {
            name: "painleve".to_owned(),
            metadata: BTreeMap::from([
                ("scenario".into(), scenario.name.clone()),
                ("configuration".into(), configuration),
                ("version".into(), env!("CARGO_PKG_VERSION").into()),
                ("source".into(), source.name().into()),
            ]),
        })?;
        let mut topics = [0; TOPICS.len()];
        for (channel, topic) in topics.iter_mut().zip(TOPICS) {
            let schema = topic.json_schema().to_string();
            *channel = add_channel(&mut writer, topic.name, topic.schema, &schema)?;
        }
        let events_schema = event_schema().to_string();
        Ok(Self {
            path,
            topics,
            events: add_channel(&mut writer, "events", "painleve.Event", &events_schema)?,
            transforms: add_channel(
                &mut writer,
                "tf",
                "foxglove.FrameTransforms",
                FRAME_TRANSFORMS,
            )?,
            scene: add_channel(&mut writer, "scene", "foxglove.SceneUpdate", SCENE_UPDATE)?,
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
        for (channel, topic) in self.topics.into_iter().zip(TOPICS) {
            if tick.estimates.is_some() || !topic.needs_estimates {
                self.write_message(channel, sequence, time_ns, &Message { topic, tick })?;
            }
        }
        if let Some(picture) = self.picture.tick(tick) {
            self.write_message(self.transforms, sequence, time_ns, &picture.transforms)?;
            self.write_message(self.scene, sequence, time_ns, &picture.scene)?;
        }
        self.sequence = sequence.wrapping_add(1);
        Ok(())
    }

    fn write_message(
        &mut self,
        channel_id: u16,
        sequence: u32,
        time_ns: u64,
        message: &impl Serialize,
    ) -> Result<(), McapError> {
        self.json.clear();
        serde_json::to_writer(&mut self.json, message).map_err(io::Error::from)?;
        let header = MessageHeader {
            channel_id,
            sequence,
            log_time: time_ns,
            publish_time: time_ns,
        };
        self.writer.write_to_known_channel(&header, &self.json)
    }

    fn complete(mut self) -> Result<AtomicFile, RecordError> {
        let file = self.writer.finish().and_then(|_| {
            let buffered = self.writer.into_inner();
            Ok(buffered.into_inner().map_err(|error| error.into_error())?)
        });
        file.map_err(|error| RecordError::write(&self.path, reason(error)))
    }
}

impl Sink for McapLog {
    fn tick(&mut self, tick: &RecordedTick<'_>) -> Result<(), RecordError> {
        self.write_tick(tick)
            .map_err(|error| RecordError::write(&self.path, reason(error)))
    }

    fn event(&mut self, event: &RunEvent) -> Result<(), RecordError> {
        let (channel, sequence) = (self.events, self.event_sequence);
        self.event_sequence = sequence.wrapping_add(1);
        let time_ns = nanoseconds(event.time_s);
        self.write_message(channel, sequence, time_ns, &event_message(event))
            .map_err(|error| RecordError::write(&self.path, reason(error)))
    }

    fn finish(self: Box<Self>) -> Result<(), RecordError> {
        Ok(self.complete()?.commit()?)
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
        self.writer
            .write_metadata(&metadata)
            .map_err(|error| RecordError::write(&self.path, reason(error)))?;
        Ok(Some(self.complete()?.commit_partial()?))
    }
}

fn reason(error: McapError) -> io::Error {
    match error {
        McapError::Io(error) => error,
        other => io::Error::other(other),
    }
}

/// Saturates: a negative or undefined time becomes zero.
fn nanoseconds(time_s: f64) -> u64 {
    (time_s * 1e9).round() as u64
}

fn add_channel(
    writer: &mut mcap::Writer<BufWriter<AtomicFile>>,
    topic: &str,
    schema_name: &str,
    schema: &str,
) -> Result<u16, McapError> {
    let schema_id = writer.add_schema(schema_name, "jsonschema", schema.as_bytes())?;
    writer.add_channel(schema_id, &format!("/{topic}"), "json", &BTreeMap::new())
}

/// The quantities of one topic at one tick.
struct Message<'a> {
    topic: &'a Topic,
    tick: &'a RecordedTick<'a>,
}

impl Serialize for Message<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let tick = self.tick;
        let mut map = serializer.serialize_map(None)?;
        for field in self.topic.fields {
            match field.read {
                Read::Number(read) => {
                    let value = read(tick);
                    if value.is_finite() {
                        map.serialize_entry(field.name, &value)?;
                    }
                }
                Read::Single(read) => {
                    let value = read(tick);
                    if value.is_finite() {
                        map.serialize_entry(field.name, &value)?;
                    }
                }
                Read::Whole(read) => map.serialize_entry(field.name, &read(tick))?,
                Read::Text(read) => map.serialize_entry(field.name, read(tick))?,
                Read::Truth(read) => map.serialize_entry(field.name, &read(tick))?,
            }
        }
        map.end()
    }
}

/// Returns an event as a message without the fields that do not apply.
fn event_message(event: &RunEvent) -> Value {
    let kind = event.kind;
    let mut message = json!({
        "time_s": event.time_s,
        "kind": kind.name(),
        "description": kind.describe(),
    });
    if let Some([tangential, normal]) = kind.impulse_ns() {
        message["impulse_t_ns"] = json!(tangential);
        message["impulse_n_ns"] = json!(normal);
    }
    if let EventKind::Plant(Event::Impact { approach_m_s, .. }) = kind {
        message["approach_m_s"] = json!(approach_m_s);
    }
    if let Some((from, to)) = kind.change() {
        message["from"] = json!(from);
        message["to"] = json!(to);
    }
    message
}

fn event_schema() -> Value {
    let property =
        |kind: &str, description: &str| json!({ "type": kind, "description": description });
    json!({
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "painleve.Event",
        "description": "An event of the run.",
        "type": "object",
        "properties": {
            "time_s": property("number", "Simulated time, s; exact, while log_time has whole nanoseconds."),
            "kind": property("string", "impact, impact-without-collision, lift-off, mode, state, fault, edge, recovery or estimates-end."),
            "description": property("string", "The event in words."),
            "approach_m_s": property("number", "Normal velocity of the tip before an impact, m/s, negative."),
            "impulse_t_ns": property("number", "Tangential impulse of the belt on the tip, N·s."),
            "impulse_n_ns": property("number", "Normal impulse of the belt on the tip, N·s."),
            "from": property("string", "Contact mode or state before a change."),
            "to": property("string", "Contact mode or state after a change."),
        },
        "required": ["time_s", "kind", "description"],
    })
}

#[cfg(test)]
mod tests;

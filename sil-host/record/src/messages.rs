//! The topics of a run as JSON messages with their JSON Schemas, for the MCAP file and for live
//! viewers.
//!
//! - `/plant`, `/sensor`, `/actuator`, `/estimates`: one message per control tick, [`fields`](crate::fields)
//! - `/events`: impacts, changes of mode and state, faults, [`events`](crate::events)
//! - `/tf`, `/scene`: the arm for Foxglove's 3-D panel, [`scene`](crate::scene)
//!
//! Messages per tick are flat, so every number is a curve in Foxglove and PlotJuggler. A value that
//! is not finite is left out.

use painleve_plant::Event;
use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};
use serde_json::{Value, json};

use crate::events::{EventKind, RunEvent};
use crate::fields::{Read, TOPICS, Topic};
use crate::recorder::RecordedTick;

/// Foxglove's published schemas; see `foxglove/README.md`.
const FRAME_TRANSFORMS: &str = include_str!("foxglove/FrameTransforms.json");
const SCENE_UPDATE: &str = include_str!("foxglove/SceneUpdate.json");

/// Number of channels: those of [`TOPICS`] in their order, then the three below.
pub const CHANNELS: usize = TOPICS.len() + 3;
/// Channel of the events, [`event_message`].
pub const EVENTS: usize = TOPICS.len();
/// Channel of the coordinate frames, [`Picture::transforms`](crate::scene::Picture::transforms).
pub const TRANSFORMS: usize = EVENTS + 1;
/// Channel of the 3-D scene, [`Picture::scene`](crate::scene::Picture::scene).
pub const SCENE: usize = EVENTS + 2;

/// A topic with the schema of its messages.
#[derive(Clone, Debug)]
pub struct Channel {
    /// The topic, as in `/plant`.
    pub topic: String,
    /// Name of the schema.
    pub schema_name: &'static str,
    /// JSON Schema of the messages.
    pub schema: String,
}

/// Returns the channels of a run.
pub fn channels() -> [Channel; CHANNELS] {
    std::array::from_fn(|number| {
        let (topic, schema_name, schema) = match number {
            EVENTS => ("events", "painleve.Event", event_schema().to_string()),
            TRANSFORMS => ("tf", "foxglove.FrameTransforms", FRAME_TRANSFORMS.into()),
            SCENE => ("scene", "foxglove.SceneUpdate", SCENE_UPDATE.into()),
            topic => {
                let topic = TOPICS[topic];
                (topic.name, topic.schema, topic.json_schema().to_string())
            }
        };
        Channel {
            topic: format!("/{topic}"),
            schema_name,
            schema,
        }
    })
}

/// Converts a simulated time to nanoseconds. Saturates: a negative or undefined time becomes zero.
pub fn nanoseconds(time_s: f64) -> u64 {
    (time_s * 1e9).round() as u64
}

/// The message of one topic at one tick: its quantities as one flat object.
#[derive(Clone, Copy, Debug)]
pub struct TickMessage<'a> {
    /// The topic, one of [`TOPICS`].
    pub topic: &'a Topic,
    /// The tick.
    pub tick: &'a RecordedTick<'a>,
}

impl Serialize for TickMessage<'_> {
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
pub fn event_message(event: &RunEvent) -> Value {
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

pub(crate) fn event_schema() -> Value {
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

//! The messages of a live run for Foxglove clients.

use std::sync::Arc;
use std::time::{Duration, Instant};

use painleve_plant::scenario::Scenario;
use painleve_record::RecordedTick;
use painleve_record::events::RunEvent;
use painleve_record::messages::{EVENTS, SCENE, TRANSFORMS, event_message, nanoseconds};
use painleve_record::scene::Scene;
use serde::Serialize;

use crate::hub::{ChannelMessage, Entry, Hub, WatchedTick};

/// Time between two pictures of the 3-D scene.
const PICTURE_INTERVAL: Duration = Duration::from_millis(16);

/// Makes the events and pictures that any client has subscribed to, and passes ticks on.
#[derive(Debug)]
pub struct Feed {
    hub: Arc<Hub>,
    scene: Scene,
    last_picture: Option<Instant>,
    entries: Vec<Entry>,
}

impl Feed {
    /// Creates the feed of a scenario's run.
    pub fn new(hub: Arc<Hub>, scenario: &Scenario) -> Self {
        Self {
            hub,
            scene: Scene::new(scenario),
            last_picture: None,
            entries: Vec::new(),
        }
    }

    /// Receives a tick.
    pub fn tick(&mut self, tick: &RecordedTick<'_>) {
        self.scene.advance(tick);
        let time_ns = nanoseconds(tick.sample.plant.time_s);
        self.entries.push(Entry::Tick(Arc::new(WatchedTick {
            sample: *tick.sample,
            estimates: tick.estimates.copied(),
        })));
        let is_due = self
            .last_picture
            .is_none_or(|last| last.elapsed() >= PICTURE_INTERVAL);
        if is_due && (self.hub.wants(TRANSFORMS) || self.hub.wants(SCENE)) {
            self.last_picture = Some(Instant::now());
            let picture = self.scene.picture(tick);
            self.add(TRANSFORMS, time_ns, || &picture.transforms);
            self.add(SCENE, time_ns, || &picture.scene);
        }
    }

    /// Receives an event.
    pub fn event(&mut self, event: &RunEvent) {
        self.add(EVENTS, nanoseconds(event.time_s), || event_message(event));
    }

    /// Passes the messages to the clients.
    pub fn send(&mut self) {
        if !self.entries.is_empty() {
            self.hub.send(&self.entries);
            self.entries.clear();
        }
    }

    fn add<M: Serialize>(&mut self, channel: usize, time_ns: u64, message: impl FnOnce() -> M) {
        // The messages contain only finite numbers and text keys, so they can be written as JSON.
        if self.hub.wants(channel)
            && let Ok(json) = serde_json::to_vec(&message())
        {
            self.entries.push(Entry::Message(Arc::new(ChannelMessage {
                channel,
                time_ns,
                json,
            })));
        }
    }
}

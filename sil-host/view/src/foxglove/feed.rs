//! The data of a live run for Foxglove clients.

use std::sync::Arc;
use std::time::{Duration, Instant};

use painleve_plant::scenario::Scenario;
use painleve_record::RecordedTick;
use painleve_record::events::RunEvent;
use painleve_record::scene::Scene;

use crate::hub::{Entry, Hub, WatchedTick};

/// Time between two pictures of the 3-D scene.
const PICTURE_INTERVAL: Duration = Duration::from_millis(16);

/// Passes ticks and events on to the clients' threads, which make the messages.
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
        let is_due = self
            .last_picture
            .is_none_or(|last| last.elapsed() >= PICTURE_INTERVAL);
        if is_due {
            self.last_picture = Some(Instant::now());
        }
        self.entries.push(Entry::Tick(Arc::new(WatchedTick {
            sample: *tick.sample,
            estimates: tick.estimates.copied(),
            scene: is_due.then(|| self.scene.clone()),
        })));
    }

    /// Receives an event.
    pub fn event(&mut self, event: &RunEvent) {
        self.entries.push(Entry::Event(*event));
    }

    /// Passes everything on to the clients.
    pub fn send(&mut self) {
        if !self.entries.is_empty() {
            self.hub.send(&self.entries);
            self.entries.clear();
        }
    }
}

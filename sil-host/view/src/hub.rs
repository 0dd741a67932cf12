//! Data on their way from a live run to its viewers: pages of this program and Foxglove clients.
//!
//! The run never waits for a viewer: each viewer has a queue, and loses what does not fit.

use std::collections::VecDeque;
use std::mem;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use painleve_plant::sample::Sample;
use painleve_plant::telemetry::Telemetry;
use painleve_record::events::RunEvent;
use painleve_record::scene::Scene;
use serde_json::{Value, json};

use crate::locked;
use crate::parameters::Parameter;

/// Most viewers of each kind at once.
pub(crate) const MOST_VIEWERS: usize = 8;
/// Bytes of rows that may wait for a page.
const MOST_BYTES: usize = 4 << 20;
/// Messages, and events, that may wait for a page.
const MOST_MESSAGES: usize = 1024;
/// What may wait for a Foxglove client: ticks and events of a few seconds.
const MOST_ENTRIES: usize = 8192;

/// The viewers of a run.
#[derive(Debug, Default)]
pub struct Hub {
    pub(crate) pages: Group<PageQueue>,
    pub(crate) clients: Group<ClientQueue>,
    /// Number of resets of the run.
    session: AtomicU64,
    parameters: Mutex<Vec<Parameter>>,
    /// What every page is told first: the run as it is now.
    description: Mutex<Option<String>>,
}

/// What waits for a page: first what it is told, then the data of the run that it was told about.
#[derive(Debug, Default)]
pub(crate) struct PageQueue {
    pub(crate) messages: VecDeque<String>,
    pub(crate) events: VecDeque<String>,
    pub(crate) rows: Vec<u8>,
}

impl PageQueue {
    /// Adds data that fit; the oldest are lost.
    fn push(&mut self, rows: &[u8], events: &[String]) {
        if self.rows.len() + rows.len() > MOST_BYTES {
            self.rows.clear();
        }
        self.rows.extend_from_slice(rows);
        add(&mut self.events, events);
    }
}

/// Adds texts; the oldest are lost if there are too many.
fn add(queue: &mut VecDeque<String>, texts: &[String]) {
    queue.extend(texts.iter().cloned());
    let excess = queue.len().saturating_sub(MOST_MESSAGES);
    queue.drain(..excess);
}

/// What waits for a Foxglove client.
#[derive(Debug, Default)]
pub(crate) struct ClientQueue {
    /// Whether it has subscribed to any channel.
    pub(crate) is_subscribed: bool,
    entries: VecDeque<Entry>,
}

/// An entry of a Foxglove client's queue.
#[derive(Clone, Debug)]
pub(crate) enum Entry {
    /// A tick. The client's thread makes its messages and its picture, so that they cost the run nothing.
    Tick(Arc<WatchedTick>),
    /// An event of the run.
    Event(RunEvent),
    /// Parameters that have changed.
    Parameters(Arc<[Parameter]>),
    /// A text for the user.
    Status(Severity, Arc<str>),
    /// The run has started again.
    Restarted,
}

/// Everything about a tick.
#[derive(Debug)]
pub(crate) struct WatchedTick {
    pub(crate) sample: Sample,
    pub(crate) estimates: Option<Telemetry>,
    /// The scene at this tick, if a picture of it is due.
    pub(crate) scene: Option<Scene>,
}

/// How a text for the user is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Severity {
    Information,
    Error,
}

impl Hub {
    /// Returns the number of viewers.
    pub fn viewers(&self) -> usize {
        self.pages.count() + self.clients.count()
    }

    /// Returns whether any page is open.
    pub fn has_pages(&self) -> bool {
        self.pages.count() > 0
    }

    /// Returns whether any Foxglove client has subscribed to a channel.
    pub fn has_subscribers(&self) -> bool {
        let clients = locked(&self.clients.queues);
        clients.iter().any(|queue| locked(queue).is_subscribed)
    }

    /// Passes rows and events to every page.
    pub fn publish(&self, rows: &[u8], events: &[Value]) {
        let events: Vec<String> = events.iter().map(Value::to_string).collect();
        self.pages.each(|queue| queue.push(rows, &events));
    }

    /// Sends a message to every page.
    pub fn tell(&self, message: &Value) {
        let message = [message.to_string()];
        self.pages.each(|queue| add(&mut queue.messages, &message));
    }

    /// Tells every page, also those to come, what runs: [`description`](crate::page::description).
    pub fn describe(&self, run: &Value) {
        let message = json!({ "run": run });
        *locked(&self.description) = Some(message.to_string());
        self.tell(&message);
    }

    /// Adds a page, which is told what runs; `None` if there are too many.
    pub(crate) fn join_page(&self) -> Option<Arc<Mutex<PageQueue>>> {
        let queue = self.pages.join()?;
        add(
            &mut locked(&queue).messages,
            locked(&self.description).as_slice(),
        );
        Some(queue)
    }

    /// Tells every viewer that a request was carried out, and how if there is something to say.
    pub fn note(&self, text: &str) {
        self.tell(&json!({ "note": text }));
        if !text.is_empty() {
            self.send(&[Entry::Status(Severity::Information, text.into())]);
        }
    }

    /// Tells every viewer why something is impossible.
    pub fn refuse(&self, text: &str) {
        self.tell(&json!({ "error": text }));
        self.send(&[Entry::Status(Severity::Error, text.into())]);
    }

    /// Tells every viewer that the run starts again.
    pub fn restart(&self) {
        self.session.fetch_add(1, Ordering::Relaxed);
        // What waits is of the run before.
        self.pages.each(|queue| {
            queue.events.clear();
            queue.rows.clear();
        });
        self.tell(&json!({ "reset": true }));
        self.send(&[Entry::Restarted]);
    }

    /// Sets the parameters that Foxglove clients see; they receive those that have changed.
    pub fn set_parameters(&self, parameters: Vec<Parameter>) {
        let mut current = locked(&self.parameters);
        let changed: Arc<[Parameter]> = parameters
            .iter()
            .filter(|parameter| !current.contains(parameter))
            .cloned()
            .collect();
        *current = parameters;
        drop(current);
        if !changed.is_empty() {
            self.send(&[Entry::Parameters(changed)]);
        }
    }

    /// Returns the parameters.
    pub(crate) fn parameters(&self) -> Vec<Parameter> {
        locked(&self.parameters).clone()
    }

    /// Returns a name for the run since its last reset.
    pub(crate) fn session(&self) -> String {
        let resets = self.session.load(Ordering::Relaxed);
        format!("{}-{resets}", std::process::id())
    }

    /// Passes entries to the Foxglove clients; ticks and events only to those that have subscribed to a
    /// channel.
    pub(crate) fn send(&self, entries: &[Entry]) {
        self.clients
            .each(|queue| entries.iter().for_each(|entry| queue.push(entry)));
    }
}

impl Entry {
    /// Whether it belongs to a channel, and may be lost.
    fn is_data(&self) -> bool {
        matches!(self, Self::Tick(_) | Self::Event(_))
    }
}

impl ClientQueue {
    fn push(&mut self, entry: &Entry) {
        if entry.is_data() && !self.is_subscribed {
            return;
        }
        if self.entries.len() >= MOST_ENTRIES {
            self.entries.retain(|waiting| !waiting.is_data());
            let excess = (self.entries.len() + 1).saturating_sub(MOST_ENTRIES);
            self.entries.drain(..excess);
        }
        self.entries.push_back(entry.clone());
    }

    /// Takes everything that waits.
    pub(crate) fn take(&mut self) -> VecDeque<Entry> {
        mem::take(&mut self.entries)
    }
}

/// The queues of one kind of viewer.
#[derive(Debug, Default)]
pub(crate) struct Group<T> {
    queues: Mutex<Vec<Arc<Mutex<T>>>>,
}

impl<T: Default> Group<T> {
    pub(crate) fn count(&self) -> usize {
        locked(&self.queues).len()
    }

    fn each(&self, mut visit: impl FnMut(&mut T)) {
        for queue in locked(&self.queues).iter() {
            visit(&mut locked(queue));
        }
    }

    /// Adds a viewer; `None` if there are too many.
    pub(crate) fn join(&self) -> Option<Arc<Mutex<T>>> {
        let mut queues = locked(&self.queues);
        if queues.len() >= MOST_VIEWERS {
            return None;
        }
        let queue = Arc::<Mutex<T>>::default();
        queues.push(queue.clone());
        Some(queue)
    }

    pub(crate) fn leave(&self, queue: &Arc<Mutex<T>>) {
        locked(&self.queues).retain(|other| !Arc::ptr_eq(other, queue));
    }
}

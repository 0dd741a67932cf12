//! Data on their way from a live run to its viewers: pages of this program and Foxglove clients.
//!
//! The run never waits for a viewer: each viewer has a queue, and loses what does not fit.

use std::collections::VecDeque;
use std::mem;
use std::sync::atomic::{AtomicU32, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use painleve_firmware::telemetry::Telemetry;
use painleve_plant::sample::Sample;
use serde_json::{Value, json};

use crate::foxglove::parameters::Parameter;

/// Most viewers of each kind at once.
const MOST_VIEWERS: usize = 8;
/// Bytes that may wait for a viewer.
const MOST_WAITING: usize = 4 << 20;

/// The viewers of a run.
#[derive(Debug, Default)]
pub struct Hub {
    pub(crate) pages: Group<PageQueue>,
    pub(crate) clients: Group<ClientQueue>,
    /// Channels to which any client has subscribed, one bit each.
    wanted: AtomicU32,
    /// Number of resets of the run.
    session: AtomicU64,
    parameters: Mutex<Vec<Parameter>>,
}

/// What waits for a page.
#[derive(Debug, Default)]
pub(crate) struct PageQueue {
    pub(crate) rows: Vec<u8>,
    pub(crate) messages: Vec<String>,
}

/// What waits for a Foxglove client.
#[derive(Debug, Default)]
pub(crate) struct ClientQueue {
    /// Channels to which it has subscribed, one bit each.
    subscribed: u32,
    entries: VecDeque<Entry>,
    bytes: usize,
}

/// An entry of a Foxglove client's queue.
#[derive(Clone, Debug)]
pub(crate) enum Entry {
    /// A tick; the client's thread makes its messages, so that they cost the run nothing.
    Tick(Arc<WatchedTick>),
    /// A message of a channel.
    Message(Arc<ChannelMessage>),
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
}

/// How a text for the user is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Severity {
    Information,
    Error,
}

/// A message of one channel.
#[derive(Debug)]
pub(crate) struct ChannelMessage {
    /// Index into [`channels`](painleve_record::messages::channels).
    pub(crate) channel: usize,
    /// Simulated time.
    pub(crate) time_ns: u64,
    /// The message as JSON.
    pub(crate) json: Vec<u8>,
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

    /// Returns whether any Foxglove client is connected.
    pub fn has_clients(&self) -> bool {
        self.clients.count() > 0
    }

    /// Passes rows and messages to every page.
    pub fn publish(&self, rows: &[u8], messages: &[Value]) {
        self.pages.each(|waiting| {
            if waiting.rows.len() + rows.len() > MOST_WAITING {
                waiting.rows.clear();
            }
            waiting.rows.extend_from_slice(rows);
            waiting
                .messages
                .extend(messages.iter().map(Value::to_string));
        });
    }

    /// Tells every viewer that a request was carried out, and how.
    pub fn note(&self, text: &str) {
        self.publish(&[], &[json!({ "note": text })]);
        self.send(&[Entry::Status(Severity::Information, text.into())]);
    }

    /// Tells every viewer why something is impossible.
    pub fn refuse(&self, text: &str) {
        self.publish(&[], &[json!({ "error": text })]);
        self.send(&[Entry::Status(Severity::Error, text.into())]);
    }

    /// Tells every viewer that the run starts again.
    pub fn restart(&self) {
        self.session.fetch_add(1, Ordering::Relaxed);
        self.publish(&[], &[json!({ "reset": true })]);
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

    /// Returns whether a Foxglove client has subscribed to a channel.
    pub(crate) fn wants(&self, channel: usize) -> bool {
        self.wanted.load(Ordering::Relaxed) & bit(channel) != 0
    }

    /// Passes entries to the Foxglove clients that have subscribed to them.
    pub(crate) fn send(&self, entries: &[Entry]) {
        self.clients
            .each(|queue| entries.iter().for_each(|entry| queue.push(entry)));
    }

    /// Sets the channels to which a client has subscribed.
    pub(crate) fn subscribe(
        &self,
        queue: &Mutex<ClientQueue>,
        channels: impl Iterator<Item = usize>,
    ) {
        locked(queue).subscribed = channels.fold(0, |bits, channel| bits | bit(channel));
        self.update_wanted();
    }

    /// Forgets a client.
    pub(crate) fn leave(&self, queue: &Arc<Mutex<ClientQueue>>) {
        self.clients.leave(queue);
        self.update_wanted();
    }

    fn update_wanted(&self) {
        let mut wanted = 0;
        self.clients.each(|queue| wanted |= queue.subscribed);
        self.wanted.store(wanted, Ordering::Relaxed);
    }
}

fn bit(channel: usize) -> u32 {
    1 << channel
}

impl ClientQueue {
    fn push(&mut self, entry: &Entry) {
        match entry {
            Entry::Message(message) => {
                if self.subscribed & bit(message.channel) == 0 {
                    return;
                }
                self.bytes += message.json.len();
            }
            // The time matters only together with messages.
            Entry::Tick(_) if self.subscribed == 0 => return,
            Entry::Tick(_) => self.bytes += size_of::<WatchedTick>(),
            _ => {}
        }
        if self.bytes > MOST_WAITING {
            self.entries
                .retain(|entry| !matches!(entry, Entry::Message(_) | Entry::Tick(_)));
            self.bytes = 0;
        }
        self.entries.push_back(entry.clone());
    }

    /// Takes everything that waits.
    pub(crate) fn take(&mut self) -> VecDeque<Entry> {
        self.bytes = 0;
        mem::take(&mut self.entries)
    }
}

/// The queues of one kind of viewer.
#[derive(Debug, Default)]
pub(crate) struct Group<T> {
    count: AtomicUsize,
    queues: Mutex<Vec<Arc<Mutex<T>>>>,
}

impl<T: Default> Group<T> {
    pub(crate) fn count(&self) -> usize {
        self.count.load(Ordering::Relaxed)
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
        self.count.store(queues.len(), Ordering::Relaxed);
        Some(queue)
    }

    pub(crate) fn leave(&self, queue: &Arc<Mutex<T>>) {
        let mut queues = locked(&self.queues);
        queues.retain(|other| !Arc::ptr_eq(other, queue));
        self.count.store(queues.len(), Ordering::Relaxed);
    }
}

/// A thread that panicked has left nothing half-done here.
pub(crate) fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

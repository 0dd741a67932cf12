//! Requests of viewers to a live run, and their way to it.
//!
//! A viewer may ask for as much as it likes: what is too much is refused before it reaches the run, and no
//! more than `MOST_WAITING` orders wait for it.

use std::collections::VecDeque;
use std::mem;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::{Duration, Instant};

use serde::Deserialize;

use crate::locked;

/// How long a viewer waits for the answer to a request.
const PATIENCE: Duration = Duration::from_secs(2);
/// Most orders that wait for the run.
const MOST_WAITING: usize = 64;
/// Most orders that a viewer may give in [`SECOND`].
const MOST_PER_S: u32 = 100;
const SECOND: Duration = Duration::from_secs(1);
/// What a viewer is told that gives more.
pub(crate) const TOO_MANY: &str = "more than 100 requests in a second: the others are refused";

/// A viewer's request. In JSON `"pause"` or `{"step": {"ticks": 1}}`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum ViewerRequest {
    /// Stops simulated time.
    Pause,
    /// Lets simulated time go on.
    Resume,
    /// Runs some ticks and pauses.
    Step {
        /// Number of control ticks.
        ticks: u32,
    },
    /// Changes the speed.
    Speed {
        /// Simulated seconds per second; 0 for as fast as possible.
        factor: f64,
    },
    /// Starts the run again.
    Reset,
    /// Changes a key of the scenario.
    Set {
        /// The key, as in `belt.friction`.
        key: String,
        /// The value in TOML.
        value: String,
    },
    /// Pushes the tip.
    Push {
        /// Force along the belt and away from it, N.
        force_n: [f64; 2],
        /// How long, s.
        duration_s: f64,
    },
}

impl ViewerRequest {
    /// Whether `later` makes this request pointless: it sets the same thing.
    fn is_replaced_by(&self, later: &Self) -> bool {
        match (self, later) {
            (Self::Set { key, .. }, Self::Set { key: other, .. }) => key == other,
            (Self::Speed { .. }, Self::Speed { .. }) => true,
            _ => false,
        }
    }
}

/// Whether a request was carried out; otherwise why not.
pub type Outcome = Result<(), String>;

/// A request on its way to the run.
#[derive(Debug)]
pub struct Order {
    /// The request.
    pub request: ViewerRequest,
    reply: Option<SyncSender<Outcome>>,
}

impl Order {
    /// Reports the outcome to the viewer, if it waits for it.
    pub fn reply(self, outcome: Outcome) {
        if let Some(reply) = self.reply {
            // A viewer that has left needs no answer.
            let _ = reply.try_send(outcome);
        }
    }
}

/// The orders that wait for the run.
#[derive(Debug, Default)]
pub struct Orders {
    waiting: Mutex<VecDeque<Order>>,
    arrived: Condvar,
}

impl Orders {
    /// Takes the oldest order; waits for one for at most `patience`.
    pub fn next(&self, patience: Duration) -> Option<Order> {
        let waiting = locked(&self.waiting);
        let waited = self
            .arrived
            .wait_timeout_while(waiting, patience, |waiting| waiting.is_empty());
        let (mut waiting, _) = waited.unwrap_or_else(PoisonError::into_inner);
        waiting.pop_front()
    }

    /// Adds an order. One that sets the same as the newest waiting one takes its place, so that the latest
    /// value wins.
    fn push(&self, order: Order) -> Outcome {
        let mut waiting = locked(&self.waiting);
        let count = waiting.len();
        match waiting.back_mut() {
            Some(last) if last.request.is_replaced_by(&order.request) => {
                mem::replace(last, order).reply(Err("replaced by a later value".into()));
            }
            _ if count >= MOST_WAITING => {
                return Err(format!(
                    "{count} requests wait for the run: try again later"
                ));
            }
            _ => waiting.push_back(order),
        }
        self.arrived.notify_one();
        Ok(())
    }
}

/// One viewer's way to the run.
#[derive(Debug)]
pub(crate) struct Desk {
    orders: Arc<Orders>,
    /// Start of the second in which orders are counted.
    since: Instant,
    count: u32,
}

impl Desk {
    pub(crate) fn new(orders: Arc<Orders>) -> Self {
        Self {
            orders,
            since: Instant::now(),
            count: 0,
        }
    }

    /// Counts an order.
    ///
    /// # Errors
    /// If it is one too many; with the message to the viewer for the first of them in a second.
    pub(crate) fn admit(&mut self) -> Result<(), Option<String>> {
        if self.since.elapsed() >= SECOND {
            (self.since, self.count) = (Instant::now(), 0);
        }
        self.count = self.count.saturating_add(1);
        match self.count.checked_sub(MOST_PER_S) {
            None | Some(0) => Ok(()),
            Some(excess) => Err((excess == 1).then(|| TOO_MANY.into())),
        }
    }

    /// Passes a request on without waiting.
    ///
    /// # Errors
    /// If too many orders wait.
    pub(crate) fn send(&self, request: ViewerRequest) -> Outcome {
        self.orders.push(Order {
            request,
            reply: None,
        })
    }

    /// Passes a request on and waits for its outcome.
    ///
    /// # Errors
    /// If it is not carried out.
    pub(crate) fn request(&self, request: ViewerRequest) -> Outcome {
        let (reply, outcome) = sync_channel(1);
        self.orders.push(Order {
            request,
            reply: Some(reply),
        })?;
        let silent = |_| "the run does not answer".to_owned();
        outcome.recv_timeout(PATIENCE).map_err(silent)?
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(key: &str, value: u32) -> ViewerRequest {
        ViewerRequest::Set {
            key: key.into(),
            value: value.to_string(),
        }
    }

    #[test]
    fn few_orders_wait_and_the_latest_value_wins() {
        let orders = Arc::<Orders>::default();
        let desk = Desk::new(orders.clone());
        for value in 0..1000 {
            desk.send(set("a", value)).unwrap();
        }
        desk.send(ViewerRequest::Pause).unwrap();
        desk.send(set("a", 7)).unwrap();
        desk.send(set("b", 8)).unwrap();
        let next = || orders.next(Duration::ZERO).map(|order| order.request);
        assert_eq!(next(), Some(set("a", 999)));
        assert_eq!(next(), Some(ViewerRequest::Pause));
        assert_eq!(next(), Some(set("a", 7)));
        assert_eq!(next(), Some(set("b", 8)));
        assert_eq!(next(), None);
        for _ in 0..MOST_WAITING {
            desk.send(ViewerRequest::Reset).unwrap();
        }
        let refusal = desk.send(ViewerRequest::Reset).unwrap_err();
        assert!(refusal.contains("64 requests"), "{refusal}");
        assert_eq!(desk.request(ViewerRequest::Reset), Err(refusal));
    }

    #[test]
    fn a_viewer_is_told_once_that_it_asks_too_much() {
        let mut desk = Desk::new(Arc::default());
        for _ in 0..MOST_PER_S {
            desk.admit().unwrap();
        }
        assert_eq!(desk.admit(), Err(Some(TOO_MANY.into())));
        for _ in 0..1000 {
            assert_eq!(desk.admit(), Err(None));
        }
        // The next second begins.
        desk.since -= SECOND;
        desk.admit().unwrap();
    }
}

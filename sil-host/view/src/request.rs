//! Requests of viewers to a live run.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Duration;

use serde::Deserialize;

/// How long a viewer waits for the answer to a request.
const PATIENCE: Duration = Duration::from_secs(2);

/// A viewer's request.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "order", rename_all = "kebab-case", deny_unknown_fields)]
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

/// Whether a request was carried out; otherwise why not.
pub type Outcome = Result<(), String>;

/// A request on its way to the run.
#[derive(Debug)]
pub struct Order {
    /// The request.
    pub request: ViewerRequest,
    reply: Option<Sender<Outcome>>,
}

impl Order {
    /// Reports the outcome to the viewer, if it waits for it.
    pub fn reply(self, outcome: Outcome) {
        if let Some(reply) = self.reply {
            // A viewer that has left needs no answer.
            let _ = reply.send(outcome);
        }
    }
}

/// A viewer's way to the run.
#[derive(Clone, Debug)]
pub(crate) struct Orders(Sender<Order>);

impl Orders {
    pub(crate) fn channel() -> (Self, Receiver<Order>) {
        let (sender, receiver) = channel();
        (Self(sender), receiver)
    }

    /// Passes a request on without waiting.
    pub(crate) fn send(&self, request: ViewerRequest) {
        let order = Order {
            request,
            reply: None,
        };
        // The receiver is gone only when the run ends.
        let _ = self.0.send(order);
    }

    /// Passes a request on and waits for its outcome.
    pub(crate) fn request(&self, request: ViewerRequest) -> Outcome {
        let (reply, outcome) = channel();
        let order = Order {
            request,
            reply: Some(reply),
        };
        let ended = || "the run does not answer".to_owned();
        self.0.send(order).map_err(|_| ended())?;
        outcome.recv_timeout(PATIENCE).map_err(|_| ended())?
    }
}

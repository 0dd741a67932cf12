//! Longest waits for a peer that is missing, and for a peer or board that is silent.

use std::time::Duration;

use clap::Args;
use painleve_board::SILENCE_LIMIT;
use painleve_link::DEFAULT_SILENCE_LIMIT;
use painleve_study_core::options::number;
use serde::{Deserialize, Serialize};

/// Default longest wait for a missing peer, s: a process that waits in vain has ended after 2 s, its
/// start and end included.
pub const WAIT_S: f64 = 1.7;

/// The option `--silence-limit-s`.
#[derive(Clone, Debug, Args, Serialize, Deserialize)]
pub struct PatienceArguments {
    /// Longest silence of the other process, s; the run then ends with code 3. A board's limit
    /// is two thirds of this. Increase it on a busy machine, or to stop at breakpoints.
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = DEFAULT_SILENCE_LIMIT.as_secs_f64(),
        value_parser = limit
    )]
    silence_limit_s: f64,
}

impl PatienceArguments {
    /// Returns the longest silence of the other process.
    pub fn peer(&self) -> Duration {
        Duration::from_secs_f64(self.silence_limit_s)
    }

    /// Returns the longest silence of a board. It is shorter, so that the bridge reports the board
    /// before the plant misses the bridge.
    pub fn board(&self) -> Duration {
        SILENCE_LIMIT.mul_f64(self.silence_limit_s / DEFAULT_SILENCE_LIMIT.as_secs_f64())
    }
}

fn limit(text: &str) -> Result<f64, String> {
    number(text, 0.1..=86_400.0, "seconds")
}

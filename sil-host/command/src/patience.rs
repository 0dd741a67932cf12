//! How long a run waits for a peer or a board that says nothing.

use std::ffi::OsString;
use std::time::Duration;

use clap::Args;
use painleve_board::SILENCE_LIMIT;
use painleve_link::DEFAULT_SILENCE_LIMIT;

/// The option `--silence-limit-s`.
#[derive(Clone, Debug, Args)]
pub struct PatienceArguments {
    /// How long a peer may be silent before the run ends with code 3, s. A board gets two thirds
    /// of it. Raise it on a machine with much else to do, or to stop at breakpoints.
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = DEFAULT_SILENCE_LIMIT.as_secs_f64(),
        value_parser = limit
    )]
    silence_limit_s: f64,
}

impl PatienceArguments {
    /// Longest silence of the other process.
    pub fn peer(&self) -> Duration {
        Duration::from_secs_f64(self.silence_limit_s)
    }

    /// Longest silence of a board: shorter, so that its bridge reports it before the plant
    /// misses the bridge.
    pub fn board(&self) -> Duration {
        SILENCE_LIMIT.mul_f64(self.silence_limit_s / DEFAULT_SILENCE_LIMIT.as_secs_f64())
    }

    /// The same as command-line arguments, for a child process.
    pub fn to_arguments(&self) -> [OsString; 2] {
        [
            "--silence-limit-s".into(),
            self.silence_limit_s.to_string().into(),
        ]
    }
}

fn limit(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(seconds) if (0.1..=86_400.0).contains(&seconds) => Ok(seconds),
        _ => Err("give a number of seconds from 0.1 to 86400".into()),
    }
}

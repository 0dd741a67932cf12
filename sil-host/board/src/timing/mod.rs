//! The cost of control ticks, in one report for every host of the controller.
//!
//! - [`tick_times`]: exact percentiles, and the worst tick
//! - [`report`]: the report, as JSON and as a table; [`figure`]: its figure
//! - [`metronome`]: wake-ups at absolute deadlines on a PC; [`cyclictest`]: those of another program

pub mod cyclictest;
pub mod figure;
pub mod metronome;
pub mod report;
pub mod tick_times;

use std::fmt;

use serde::{Deserialize, Serialize};

pub use cyclictest::{Cyclictest, CyclictestError};
pub use metronome::Metronome;
pub use report::TimingReport;
pub use tick_times::TickTimes;

/// Unit of a cost.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Unit {
    /// Instructions of an emulated processor: no pipeline, no flash wait states, no bus.
    Instructions,
    /// Counts of a board's stopwatch.
    Cycles {
        /// Counts per second.
        hz: u32,
    },
    /// Nanoseconds of the monotonic clock.
    Nanoseconds,
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Instructions => f.write_str("instructions"),
            Self::Cycles { hz } => write!(f, "cycles of {} MHz", f64::from(*hz) * 1e-6),
            Self::Nanoseconds => f.write_str("ns"),
        }
    }
}

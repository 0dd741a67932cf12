//! The options of the chaos test. `cargo xtask chaos` contains this file, too, to refuse options before it builds anything.

use std::ffi::OsString;

use clap::builder::RangedU64ValueParser;
use clap::error::ErrorKind;
use clap::{CommandFactory, Parser, ValueEnum, value_parser};

/// Highest number of a system call, more than any trial's process makes.
const MOST_CALLS: u32 = 1_000_000;

/// Disturbs plant and controller at every system call and counts the flaws.
#[derive(Debug, Parser)]
#[command(name = "cargo xtask chaos")]
pub struct ChaosArguments {
    /// First system call.
    #[arg(long, default_value_t = 1, value_parser = call())]
    pub first: u32,
    /// Last system call.
    #[arg(long, default_value_t = 300, value_parser = call())]
    pub last: u32,
    /// Only these disturbances.
    #[arg(long, value_enum, value_delimiter = ',', default_values_t = Disturbance::ALL)]
    pub disturbances: Vec<Disturbance>,
    /// Number of trials, drawn from all with --seed.
    #[arg(long, value_parser = number(1_000_000_000))]
    pub trials: Option<usize>,
    /// Begin no trial after so many seconds.
    #[arg(long, value_name = "SECONDS", value_parser = value_parser!(u64).range(1..=1_000_000))]
    pub stop_after_s: Option<u64>,
    /// Seed of the draw.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Instead of sending signals, make the first N calls of each kind fail: no space, a bad disk,
    /// no descriptors, no memory, an interruption. Requires strace.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = value_parser!(u32).range(..=i64::from(MOST_CALLS)))]
    pub faults: u32,
    /// Seconds within which all processes must have ended after a disturbance. Exceed the
    /// guaranteed 5 s only where other work keeps the machine busy; the limits of silence grow along.
    #[arg(long, default_value_t = 5, value_parser = value_parser!(u64).range(1..=3600))]
    pub end_s: u64,
    /// Number of parallel trials.
    #[arg(long, default_value_t = 4, value_parser = number(256))]
    pub jobs: usize,
    /// Number of additional plants and controllers on the bus of every trial.
    #[arg(long, default_value_t = 0, value_parser = value_parser!(u32).range(..=256))]
    pub crowd: u32,
    /// What runs the controller.
    #[arg(long, value_enum, default_value = "native")]
    pub host: ChaosHost,
    /// So many threads keep the machine busy meanwhile.
    #[arg(long, default_value_t = 0, value_parser = RangedU64ValueParser::<usize>::new().range(..=256))]
    pub load: usize,
}

/// A number of a system call.
fn call() -> clap::builder::RangedI64ValueParser<u32> {
    value_parser!(u32).range(1..=i64::from(MOST_CALLS))
}

/// A number of at least one.
fn number(most: u64) -> RangedU64ValueParser<usize> {
    RangedU64ValueParser::new().range(1..=most)
}

impl ChaosArguments {
    /// Reads a command line.
    ///
    /// # Errors
    /// If an option is unknown or out of range, or no system call is between the first and the last.
    pub fn read(
        line: impl IntoIterator<Item = impl Into<OsString> + Clone>,
    ) -> clap::error::Result<Self> {
        let read = Self::try_parse_from(line)?;
        if read.first > read.last {
            let message = format!(
                "--last {} is before --first {}: give --last from {} to {MOST_CALLS}",
                read.last, read.first, read.first
            );
            return Err(Self::command().error(ErrorKind::ValueValidation, message));
        }
        Ok(read)
    }
}

/// Kind of disturbance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, ValueEnum)]
pub enum Disturbance {
    Kill,
    Stop,
    /// The process is stopped, and continued while its peer still waits.
    Pause,
    Terminate,
    Interrupt,
}

impl Disturbance {
    pub const ALL: [Self; 5] = [
        Self::Kill,
        Self::Stop,
        Self::Pause,
        Self::Terminate,
        Self::Interrupt,
    ];
}

/// Kind of host of the controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ChaosHost {
    /// The controller in its own process.
    Native,
    /// The image under QEMU.
    Qemu,
    /// The image under QEMU behind a serial line.
    Serial,
}

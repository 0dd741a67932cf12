//! `cyclictest` of rt-tests beside the controller: what this machine grants a program that only sleeps and
//! reads the clock, at the same rate and at the same time.

use std::process::{Child, Command, Stdio};

use super::{TickTimes, TimingReport, Unit};

/// The program, of Debian's package `rt-tests`.
const PROGRAM: &str = "cyclictest";

/// Why there is no comparison.
#[derive(Debug, thiserror::Error)]
pub enum CyclictestError {
    /// The controller does not wait for this machine's clock.
    #[error("--cyclictest needs --host native: other hosts do not wait for this machine's clock")]
    OtherHost,
    /// It does not start.
    #[error("{PROGRAM} does not start ({0}): install Debian's package rt-tests")]
    Start(std::io::Error),
    /// It failed, for example because it may not use the priority.
    #[error("{PROGRAM} failed: {0}")]
    Failed(String),
    /// Its output names no latency.
    #[error("{PROGRAM} measured nothing")]
    Empty,
}

/// A running `cyclictest`.
#[derive(Debug)]
pub struct Cyclictest {
    child: Child,
    tick_hz: u32,
}

impl Cyclictest {
    /// Starts it for `ticks` wake-ups at `tick_hz`, with a priority under `SCHED_FIFO` or as an ordinary
    /// thread.
    ///
    /// # Errors
    /// [`CyclictestError::Start`].
    pub fn start(
        tick_hz: u32,
        ticks: u64,
        fifo_priority: Option<u8>,
    ) -> Result<Self, CyclictestError> {
        let mut command = Command::new(PROGRAM);
        let interval_us = (1_000_000 / tick_hz.max(1)).max(1);
        command
            .args(["--threads=1", "--nsecs", "--verbose"])
            .arg(format!("--interval={interval_us}"))
            .arg(format!("--loops={ticks}"));
        match fifo_priority {
            Some(priority) => command
                .args(["--policy=fifo", "--mlockall"])
                .arg(format!("--priority={priority}")),
            None => command.arg("--policy=other"),
        };
        let child = command
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(CyclictestError::Start)?;
        Ok(Self { child, tick_hz })
    }

    /// Waits until it has ended; returns its latencies as the report of a scenario of its own.
    ///
    /// # Errors
    /// [`CyclictestError`].
    pub fn finish(self) -> Result<TimingReport, CyclictestError> {
        let tick_hz = self.tick_hz;
        let output = self
            .child
            .wait_with_output()
            .map_err(CyclictestError::Start)?;
        if !output.status.success() {
            let text = String::from_utf8_lossy(&output.stderr).trim().to_owned();
            return Err(CyclictestError::Failed(text));
        }
        let times = latencies_ns(&String::from_utf8_lossy(&output.stdout));
        if times.ticks() == 0 {
            return Err(CyclictestError::Empty);
        }
        let period_ns = 1_000_000_000 / tick_hz.max(1);
        let late = |(cost, ticks): (u32, u64)| if cost >= period_ns { ticks } else { 0 };
        Ok(TimingReport {
            missed_deadlines: times.histogram().into_iter().map(late).sum(),
            ..TimingReport::new(
                PROGRAM,
                tick_hz,
                PROGRAM,
                "wake-up",
                Unit::Nanoseconds,
                &times,
            )
        })
    }
}

/// Returns the latencies in lines "thread: number: latency".
fn latencies_ns(text: &str) -> TickTimes {
    let mut times = TickTimes::default();
    for line in text.lines() {
        let mut fields = line.split(':').map(str::trim);
        let (Some(_), Some(number), Some(latency)) = (fields.next(), fields.next(), fields.next())
        else {
            continue;
        };
        if number.parse::<u64>().is_ok()
            && let Ok(latency) = latency.parse::<u64>()
        {
            times.push_cost(u32::try_from(latency).unwrap_or(u32::MAX));
        }
    }
    times
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn latencies_are_read_from_the_verbose_output_and_other_lines_are_not() {
        let text = "# /dev/cpu_dma_latency set to 0us\n\
                    Max CPUs = 4\n\
                           0:       0:       37210\n\
                           0:       1:     2253100\n\
                    T: 0 (  321) P: 0 I:1000 C:    300 Min:     37 Act: 74 Avg: 486 Max: 22531\n";
        let times = latencies_ns(text);
        assert_eq!(times.histogram(), [(37_210, 1), (2_253_100, 1)]);
        assert!(times.worst().is_none());
    }
}

//! `cyclictest` of rt-tests beside the controller: what this machine grants a program that only sleeps and
//! reads the clock, at the same rate and at the same time.

use std::ffi::OsStr;
use std::io::{self, BufRead, BufReader, Read};
use std::process::{ChildStderr, Command, Stdio};
use std::thread::{self, JoinHandle};

use painleve_process::lifetime::{Guarded, Signal, end_with_parent};

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

/// A running `cyclictest`, which ends when this value is dropped.
pub struct Cyclictest {
    child: Guarded,
    /// Reads its output while it runs: once the pipe is full, `cyclictest` overwrites what it has not written yet.
    latencies_ns: JoinHandle<TickTimes>,
    complaint: ChildStderr,
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
        Self::start_program(PROGRAM.as_ref(), tick_hz, ticks, fifo_priority)
            .map_err(CyclictestError::Start)
    }

    fn start_program(
        program: &OsStr,
        tick_hz: u32,
        ticks: u64,
        fifo_priority: Option<u8>,
    ) -> io::Result<Self> {
        let mut command = Command::new(program);
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
        command
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        let mut child = end_with_parent(&mut command, Signal::SIGTERM).spawn()?;
        let pipes = child.stdout.take().zip(child.stderr.take());
        // From now on it is ended if a thread is refused.
        let child = Guarded::new(child);
        let (output, complaint) = pipes.ok_or(io::ErrorKind::BrokenPipe)?;
        Ok(Self {
            child,
            latencies_ns: thread::Builder::new()
                .spawn(move || latencies_ns(BufReader::new(output)))?,
            complaint,
            tick_hz,
        })
    }

    /// Waits until it has ended; returns its latencies as the report of a scenario of its own.
    ///
    /// # Errors
    /// [`CyclictestError`].
    pub fn finish(mut self) -> Result<TimingReport, CyclictestError> {
        let tick_hz = self.tick_hz;
        let mut complaint = Vec::new();
        let read = self.complaint.read_to_end(&mut complaint);
        let status = read.and_then(|_| self.child.child().wait());
        if !status.map_err(CyclictestError::Start)?.success() {
            let text = String::from_utf8_lossy(&complaint).trim().to_owned();
            return Err(CyclictestError::Failed(text));
        }
        let times = self.latencies_ns.join().unwrap_or_default();
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
fn latencies_ns(output: impl BufRead) -> TickTimes {
    let mut times = TickTimes::default();
    for line in output.lines().map_while(Result::ok) {
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
    use std::os::unix::fs::PermissionsExt;
    use std::time::{Duration, Instant};

    use super::*;

    #[test]
    fn latencies_are_read_from_the_verbose_output_and_other_lines_are_not() {
        let text = "# /dev/cpu_dma_latency set to 0us\n\
                    Max CPUs = 4\n\
                           0:       0:       37210\n\
                           0:       1:     2253100\n\
                    T: 0 (  321) P: 0 I:1000 C:    300 Min:     37 Act: 74 Avg: 486 Max: 22531\n";
        let times = latencies_ns(text.as_bytes());
        assert_eq!(times.histogram(), [(37_210, 1), (2_253_100, 1)]);
        assert!(times.worst().is_none());
    }

    #[test]
    fn the_output_is_read_while_cyclictest_runs() {
        let folder = tempfile::tempdir().unwrap();
        let program = folder.path().join("cyclictest");
        let all_written = folder.path().join("all-written");
        let script = format!(
            "#!/bin/sh\nseq -f '0:%.0f:70' 100000\n: > {}\nexec sleep 0.1\n",
            all_written.display()
        );
        std::fs::write(&program, script).unwrap();
        let executable = std::fs::Permissions::from_mode(0o755);
        std::fs::set_permissions(&program, executable).unwrap();
        let running = Cyclictest::start_program(program.as_ref(), 1000, 100_000, None).unwrap();
        let start = Instant::now();
        while !all_written.exists() {
            assert!(start.elapsed() < Duration::from_secs(20), "it waits");
            thread::sleep(Duration::from_millis(1));
        }
        assert_eq!(running.finish().unwrap().ticks, 100_000);
    }
}

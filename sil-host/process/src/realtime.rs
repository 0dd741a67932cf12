//! Real-time pacing: absolute deadlines, and the privileges that the system grants.

use std::fmt;
use std::io;
use std::time::Duration;

use crate::terminal::warn;
use nix::errno::Errno;
use nix::libc::{SCHED_FIFO, SYS_sched_setscheduler, c_int, syscall};
use nix::sys::mman::{MlockAllFlags, mlockall};
use nix::sys::prctl::set_timerslack;
use nix::sys::resource::{RLIM_INFINITY, Resource, getrlimit};
use nix::sys::time::TimeSpec;
use nix::time::{ClockId, ClockNanosleepFlags, clock_gettime, clock_nanosleep};

/// Priority under `SCHED_FIFO`: above all ordinary threads, just below the interrupt threads (50)
/// of a real-time kernel, on which the wake-ups depend.
pub const FIFO_PRIORITY: u8 = 49;

/// Waiting on the monotonic clock failed.
#[derive(Debug, thiserror::Error)]
#[error("cannot wait on the monotonic clock: {0}")]
pub struct ClockError(#[from] io::Error);

/// Wakes once per period at absolute deadlines of the monotonic clock, so that delays do not
/// accumulate.
///
/// After a wake-up later than a period, the following ones come without sleep until the deadlines
/// are caught up; none is skipped.
#[derive(Debug)]
pub struct Pacer {
    deadline: TimeSpec,
    period: TimeSpec,
}

impl Pacer {
    /// Starts the clock: the first deadline is one `period` from now.
    ///
    /// # Errors
    /// If the monotonic clock cannot be read.
    pub fn start(period: Duration) -> io::Result<Self> {
        Ok(Self {
            deadline: clock_gettime(ClockId::CLOCK_MONOTONIC)?,
            period: TimeSpec::from_duration(period),
        })
    }

    /// Sleeps until the next deadline; returns the latency of the wake-up.
    ///
    /// # Errors
    /// [`ClockError`]. A signal does not end the wait.
    pub fn wait(&mut self) -> Result<Duration, ClockError> {
        self.deadline = self.deadline + self.period;
        loop {
            match clock_nanosleep(
                ClockId::CLOCK_MONOTONIC,
                ClockNanosleepFlags::TIMER_ABSTIME,
                &self.deadline,
            ) {
                Ok(_) => break,
                Err(Errno::EINTR) => {}
                Err(error) => return Err(ClockError(error.into())),
            }
        }
        let now = Duration::from(clock_gettime(ClockId::CLOCK_MONOTONIC).map_err(io::Error::from)?);
        Ok(now.saturating_sub(self.deadline.into()))
    }
}

/// Which real-time requests the system granted; printed as a one-line notice.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RealtimeStatus {
    /// Whether this thread has `SCHED_FIFO`; otherwise the reason.
    pub scheduling: Result<(), String>,
    /// Whether the memory of the process is locked; otherwise the reason.
    pub memory: Result<(), String>,
}

impl RealtimeStatus {
    /// Returns whether all requests were granted.
    pub fn is_complete(&self) -> bool {
        self.scheduling.is_ok() && self.memory.is_ok()
    }

    /// Tells what `process` was granted; `quiet` only if something was refused.
    pub fn tell(&self, process: &str, quiet: bool) {
        if !quiet || !self.is_complete() {
            warn(format_args!("{process}: {self}"));
        }
    }
}

impl fmt::Display for RealtimeStatus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.scheduling {
            Ok(()) => write!(f, "real time: SCHED_FIFO priority {FIFO_PRIORITY}")?,
            Err(reason) => write!(f, "real time: SCHED_FIFO not permitted ({reason})")?,
        }
        match &self.memory {
            Ok(()) => write!(f, ", memory locked")?,
            Err(reason) => write!(f, ", memory not locked ({reason})")?,
        }
        if !self.is_complete() {
            write!(
                f,
                "; expect late ticks, or raise `ulimit -r` and `ulimit -l`"
            )?;
        }
        Ok(())
    }
}

/// Requests `SCHED_FIFO` for the calling thread and locked memory for the process, and returns
/// which requests were granted. Call it after all set-up: where locked memory is limited, only the
/// memory mapped by then is locked.
pub fn request_realtime() -> RealtimeStatus {
    // Removes the 50 µs timer slack of an ordinary thread. This needs no permission; kernels
    // without the setting ignore it.
    let _ = set_timerslack(1);
    RealtimeStatus {
        scheduling: request_fifo(),
        memory: lock_memory(),
    }
}

#[allow(unsafe_code)]
fn request_fifo() -> Result<(), String> {
    let priority = c_int::from(FIFO_PRIORITY);
    // The system call itself: musl's function of this name always fails.
    // SAFETY: the system reads its `sched_param`, which is this one integer; 0 means the calling thread.
    let result = unsafe { syscall(SYS_sched_setscheduler, 0, SCHED_FIFO, &raw const priority) };
    Errno::result(result)
        .map(|_| ())
        .map_err(|error| error.desc().to_owned())
}

fn lock_memory() -> Result<(), String> {
    // Under a limit, locking future memory would make a later allocation fail.
    let unlimited =
        getrlimit(Resource::RLIMIT_MEMLOCK).is_ok_and(|(soft, _)| soft == RLIM_INFINITY);
    let mut flags = MlockAllFlags::MCL_CURRENT;
    flags.set(MlockAllFlags::MCL_FUTURE, unlimited);
    mlockall(flags).map_err(|error| match error {
        Errno::ENOMEM if !unlimited => "it is more than `ulimit -l` allows".to_owned(),
        _ => error.desc().to_owned(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nix::sys::mman::munlockall;

    #[test]
    fn deadlines_do_not_drift() {
        let period = Duration::from_millis(2);
        let mut pacer = Pacer::start(period).unwrap();
        let start = pacer.deadline;
        for _ in 0..10 {
            pacer.wait().unwrap();
        }
        assert_eq!(
            Duration::from(pacer.deadline) - Duration::from(start),
            10 * period
        );
    }

    #[test]
    fn a_late_tick_returns_its_latency_and_is_caught_up() {
        let period = Duration::from_millis(1);
        let mut pacer = Pacer::start(period).unwrap();
        std::thread::sleep(20 * period);
        assert!(pacer.wait().unwrap() >= 19 * period);
        assert!(pacer.wait().unwrap() >= 18 * period);
    }

    #[test]
    fn the_notice_is_one_line_and_names_the_refused_requests() {
        let granted = RealtimeStatus {
            scheduling: Ok(()),
            memory: Ok(()),
        };
        assert_eq!(
            granted.to_string(),
            "real time: SCHED_FIFO priority 49, memory locked"
        );
        let refused = RealtimeStatus {
            scheduling: Err("Operation not permitted".to_owned()),
            memory: Err("Cannot allocate memory".to_owned()),
        };
        assert_eq!(
            refused.to_string(),
            "real time: SCHED_FIFO not permitted (Operation not permitted), \
             memory not locked (Cannot allocate memory); \
             expect late ticks, or raise `ulimit -r` and `ulimit -l`"
        );
    }

    #[test]
    fn a_refused_request_is_not_an_error() {
        // In its own thread, so that the policy ends with it.
        let status = std::thread::spawn(request_realtime).join().unwrap();
        assert_eq!(status.to_string().lines().count(), 1);
        munlockall().unwrap();
    }
}

//! A child process of a run, with its output.

use std::io::Read;
use std::process::{ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use painleve_process::lifetime::Guarded;

use super::CommandError;
use super::plan::Plan;
use super::process_error::ProcessError;

/// Interval between two checks of the children.
pub const WATCH: Duration = Duration::from_millis(10);

/// A child process with its output.
pub struct RunProcess {
    /// The process, which is killed when this is dropped.
    pub child: Guarded,
    /// Its standard output, if it is piped.
    pub stdout: Reader,
    /// Its standard error, if it is piped.
    pub stderr: Reader,
    stopped: Duration,
}

impl RunProcess {
    /// Starts this program with a plan.
    ///
    /// # Errors
    /// [`CommandError::Process`] if the process or the threads that read its output cannot be started.
    pub fn start(plan: &Plan, stderr: Stdio) -> Result<Self, CommandError> {
        let program = std::env::current_exe()?;
        let mut command = plan.command(&program).map_err(std::io::Error::from)?;
        command
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(stderr);
        let mut child = command
            .spawn()
            .map_err(|source| ProcessError::Start { program, source })?;
        let (stdout, stderr) = (child.stdout.take(), child.stderr.take());
        // From now on it is ended if a thread is refused.
        let child = Guarded::new(child);
        Ok(Self {
            stdout: Reader::start(stdout).map_err(ProcessError::Thread)?,
            stderr: Reader::start(stderr).map_err(ProcessError::Thread)?,
            child,
            stopped: Duration::ZERO,
        })
    }

    /// Waits until the process has ended, at most for `limit`; `None` if it still runs.
    ///
    /// # Errors
    /// Those of the operating system.
    pub fn wait(&mut self, limit: Duration) -> std::io::Result<Option<ExitStatus>> {
        let start = std::time::Instant::now();
        while start.elapsed() < limit {
            if let Some(status) = self.child.ended()? {
                return Ok(Some(status));
            }
            std::thread::sleep(WATCH);
        }
        Ok(None)
    }

    /// Returns how long the process has been stopped, if it is checked every `interval`. The
    /// function counts checks rather than time, because this process may be stopped together with
    /// its children.
    pub fn stopped_for(&mut self, interval: Duration) -> Duration {
        self.stopped = if self.child.is_stopped() {
            self.stopped + interval
        } else {
            Duration::ZERO
        };
        self.stopped
    }
}

/// Returns the error output of an ended process as a suffix of another message.
pub fn complaint(text: &str) -> String {
    match text.trim().trim_start_matches("error: ") {
        "" => String::new(),
        text => format!(": {text}"),
    }
}

/// Reads a pipe while its process runs: a pipe that is not read blocks its writer once it is full.
pub struct Reader(Option<Receiver<Vec<u8>>>);

impl Reader {
    /// Bytes of a pipe to keep; the rest is read and discarded.
    const KEPT: u64 = 4 << 20;
    /// How long a pipe may stay open after its process has ended: on a busy machine, reading the
    /// output takes a while.
    const PATIENCE: Duration = Duration::from_secs(3);

    fn start(pipe: Option<impl Read + Send + 'static>) -> std::io::Result<Self> {
        let Some(mut pipe) = pipe else {
            return Ok(Self(None));
        };
        let (sender, receiver) = channel();
        std::thread::Builder::new().spawn(move || {
            let mut text = Vec::new();
            // Unreadable output is left out.
            let _ = pipe.by_ref().take(Self::KEPT).read_to_end(&mut text);
            let _ = std::io::copy(&mut pipe, &mut std::io::sink());
            let _ = sender.send(text);
        })?;
        Ok(Self(Some(receiver)))
    }

    /// Returns the whole output once the process has ended; empty on a second call.
    pub fn text(&mut self) -> String {
        let text = self
            .0
            .take()
            .and_then(|text| text.recv_timeout(Self::PATIENCE).ok());
        String::from_utf8_lossy(&text.unwrap_or_default()).into_owned()
    }
}

//! A process that stops at each of its system calls up to a given one.

use std::io;
use std::os::unix::process::CommandExt;
use std::process::{Child, Command};
use std::time::{Duration, Instant};

use nix::sys::ptrace;
use nix::sys::signal::{Signal, kill};
use nix::sys::wait::{WaitPidFlag, WaitStatus, waitpid};
use nix::unistd::Pid;

/// Result of tracing a process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Traced {
    /// The signal was sent at the system call.
    Injected,
    /// The process ended before, with this exit code if it had one.
    Ended(Option<i32>),
}

/// A process whose main thread is traced. Only the thread that starts the process can trace it.
pub struct Victim {
    pub child: Child,
    id: Pid,
}

impl Victim {
    /// Starts a command, stopped before its first instruction.
    ///
    /// # Errors
    /// An error of the system if the process cannot be started or traced.
    #[allow(unsafe_code)]
    pub fn start(command: &mut Command) -> io::Result<Self> {
        // SAFETY: between fork and exec, one system call that is async-signal-safe.
        let child = unsafe { command.pre_exec(|| Ok(ptrace::traceme()?)) }.spawn()?;
        let id = Pid::from_raw(i32::try_from(child.id()).map_err(io::Error::other)?);
        let victim = Self { child, id };
        match waitpid(id, None)? {
            WaitStatus::Stopped(_, Signal::SIGTRAP) => {}
            other => return Err(io::Error::other(format!("no stop after exec: {other:?}"))),
        }
        ptrace::setoptions(
            id,
            ptrace::Options::PTRACE_O_TRACESYSGOOD | ptrace::Options::PTRACE_O_EXITKILL,
        )?;
        Ok(victim)
    }

    /// Runs the process up to the start of its system call `number`, counted from 1, sends it
    /// `signal` there and detaches from it. Gives up after `limit`.
    ///
    /// # Errors
    /// An error of the system if the process cannot be traced.
    pub fn signal_at(
        &mut self,
        number: u32,
        signal: Signal,
        limit: Duration,
    ) -> io::Result<Traced> {
        let deadline = Instant::now() + limit;
        let mut stops = 0;
        let mut forward = None;
        loop {
            ptrace::syscall(self.id, forward.take())?;
            match self.next_stop(deadline)? {
                WaitStatus::PtraceSyscall(_) => {
                    stops += 1;
                    // Every call stops the process twice: on entry and on exit.
                    if stops == 2 * number - 1 {
                        kill(self.id, signal)?;
                        if signal != Signal::SIGKILL {
                            ptrace::detach(self.id, None)?;
                        }
                        return Ok(Traced::Injected);
                    }
                }
                WaitStatus::Stopped(_, received) => forward = Some(received),
                WaitStatus::Exited(_, code) => return Ok(Traced::Ended(Some(code))),
                WaitStatus::Signaled(..) => return Ok(Traced::Ended(None)),
                _ => {}
            }
        }
    }

    fn next_stop(&self, deadline: Instant) -> io::Result<WaitStatus> {
        loop {
            let status = waitpid(self.id, Some(WaitPidFlag::WNOHANG | WaitPidFlag::__WALL))?;
            if status != WaitStatus::StillAlive {
                return Ok(status);
            }
            if Instant::now() >= deadline {
                kill(self.id, Signal::SIGKILL)?;
                return Err(io::Error::other("a traced process does not continue"));
            }
            // Most system calls return at once.
            std::thread::yield_now();
        }
    }
}

//! Child processes that never outlive their parent.

use std::io;
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, ExitStatus};
use std::time::{Duration, Instant};

use nix::errno::Errno;
use nix::sys::prctl::set_pdeathsig;
pub use nix::sys::signal::Signal;
use nix::sys::signal::kill;
use nix::sys::wait::{Id, WaitPidFlag, WaitStatus, waitid};
use nix::unistd::{Pid, getpid, getppid};

/// Makes the kernel send `signal` to a command's process when the thread that starts it ends,
/// however it ends. Choose [`Signal::SIGKILL`] for a program that ignores requests to end.
///
/// Starting the command fails if that thread has already ended. It does not matter which process
/// inherits orphans; it is not always process 1.
#[allow(unsafe_code)]
pub fn end_with_parent(command: &mut Command, signal: Signal) -> &mut Command {
    let parent = getpid();
    // SAFETY: the closure runs between fork and exec, where only async-signal-safe calls are
    // allowed; it makes two system calls and does not allocate.
    unsafe { command.pre_exec(move || end_this_with(parent, signal)) }
}

/// Makes the kernel send `signal` to this process when `parent`, which has started it with [`end_with_parent`], ends. A
/// program that has capabilities of its own (`setcap`) must ask again: the kernel forgets the request when it starts one.
///
/// # Errors
/// If the parent has ended.
pub fn end_this_with(parent: Pid, signal: Signal) -> io::Result<()> {
    set_pdeathsig(signal)?;
    // Without this check, a parent that ended before the request would go unnoticed.
    if getppid() == parent {
        Ok(())
    } else {
        Err(io::Error::from_raw_os_error(Errno::ESRCH as i32))
    }
}

/// A child that is ended, by force if necessary, when this value is dropped.
pub struct Guarded {
    child: Child,
    grace: Duration,
}

/// Time between asking a child to end and killing it, unless set otherwise.
const GRACE: Duration = Duration::from_millis(1000);

impl Guarded {
    /// Takes ownership of a child.
    pub fn new(child: Child) -> Self {
        Self {
            child,
            grace: GRACE,
        }
    }

    /// Sets the time between asking the child to end and killing it.
    pub fn set_grace(&mut self, grace: Duration) {
        self.grace = grace;
    }

    /// Returns the child, for its pipes.
    pub fn child(&mut self) -> &mut Child {
        &mut self.child
    }

    /// Returns the child's process id.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Returns the child's exit status, if it has ended.
    ///
    /// # Errors
    /// If the system cannot report it.
    pub fn ended(&mut self) -> io::Result<Option<ExitStatus>> {
        self.child.try_wait()
    }

    /// Returns whether the child is stopped, as by SIGSTOP.
    pub fn is_stopped(&self) -> bool {
        let Ok(id) = i32::try_from(self.child.id()) else {
            return false;
        };
        // WNOWAIT leaves the exit status for `ended`.
        let look = WaitPidFlag::WSTOPPED | WaitPidFlag::WNOHANG | WaitPidFlag::WNOWAIT;
        matches!(
            waitid(Id::Pid(Pid::from_raw(id)), look),
            Ok(WaitStatus::Stopped(..))
        )
    }

    /// Kills the child.
    pub fn kill(&mut self) {
        // An error means that the child has just ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }

    /// Asks the child to end, waits, then kills it; returns its exit status.
    pub fn stop(&mut self) -> Option<ExitStatus> {
        if let Ok(Some(status)) = self.child.try_wait() {
            return Some(status);
        }
        if let Ok(id) = i32::try_from(self.child.id()) {
            // An error means that the child has just ended.
            let _ = kill(Pid::from_raw(id), Signal::SIGTERM);
        }
        let asked = Instant::now();
        while asked.elapsed() < self.grace {
            if let Ok(Some(status)) = self.child.try_wait() {
                return Some(status);
            }
            if self.is_stopped() {
                // A stopped child cannot react.
                break;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        self.kill();
        self.child.wait().ok()
    }
}

impl Drop for Guarded {
    fn drop(&mut self) {
        self.stop();
    }
}

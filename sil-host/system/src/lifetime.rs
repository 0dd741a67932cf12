//! Child processes that never outlive whoever started them.

use std::io;
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, ExitStatus};
use std::time::{Duration, Instant};

use nix::sys::prctl::set_pdeathsig;
use nix::sys::signal::{Signal, kill};
use nix::unistd::{Pid, getppid};

/// Asks the kernel to end this process when its parent ends.
///
/// # Errors
/// If the kernel refuses, or the parent is gone already.
pub fn end_with_parent() -> io::Result<()> {
    set_pdeathsig(Signal::SIGTERM)?;
    // A parent that ended before the request would never be noticed.
    if getppid() == Pid::from_raw(1) {
        return Err(io::Error::other(
            "the process that started this one is gone",
        ));
    }
    Ok(())
}

/// Makes the kernel kill a command's process when the thread that started it ends. For a
/// program that is not ours and ignores requests to end.
#[allow(unsafe_code)]
pub fn kill_with_parent(command: &mut Command) -> &mut Command {
    // SAFETY: the closure runs between fork and exec, where only async-signal-safe
    // calls are allowed; it makes one system call and does not allocate.
    unsafe { command.pre_exec(|| Ok(set_pdeathsig(Signal::SIGKILL)?)) }
}

/// A child that is ended, by force if need be, when this value goes.
pub struct Guarded(Child);

/// Time between asking a child to end and forcing it.
const GRACE: Duration = Duration::from_millis(300);

impl Guarded {
    /// Takes charge of a child.
    pub fn new(child: Child) -> Self {
        Self(child)
    }

    /// The child itself, for its pipes.
    pub fn child(&mut self) -> &mut Child {
        &mut self.0
    }

    /// How the child ended, if it has.
    ///
    /// # Errors
    /// If the system cannot tell.
    pub fn ended(&mut self) -> io::Result<Option<ExitStatus>> {
        self.0.try_wait()
    }

    /// Forces the child to end.
    pub fn kill(&mut self) {
        // Errors mean that it has just ended.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }

    /// Asks the child to end, waits a while, then forces it.
    pub fn stop(&mut self) {
        if let Ok(Some(_)) = self.0.try_wait() {
            return;
        }
        if let Ok(id) = i32::try_from(self.0.id()) {
            // An error means that it has just ended.
            let _ = kill(Pid::from_raw(id), Signal::SIGTERM);
        }
        let asked = Instant::now();
        while asked.elapsed() < GRACE {
            if let Ok(Some(_)) = self.0.try_wait() {
                return;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        self.kill();
    }
}

impl Drop for Guarded {
    fn drop(&mut self) {
        self.stop();
    }
}

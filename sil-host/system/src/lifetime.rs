//! Child processes that never outlive whoever started them.

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

/// Makes the kernel send a command's process `signal` when the thread that starts it ends,
/// however that ends: [`Signal::SIGKILL`] for a program that ignores requests to end.
///
/// Starting the command fails if that thread is gone already. Which process inherits orphans
/// does not matter: it is not always the first one.
#[allow(unsafe_code)]
pub fn end_with_parent(command: &mut Command, signal: Signal) -> &mut Command {
    let parent = getpid();
    let request = move || {
        set_pdeathsig(signal)?;
        // A parent that ended before the request would never be noticed.
        if getppid() == parent {
            Ok(())
        } else {
            Err(io::Error::from_raw_os_error(Errno::ESRCH as i32))
        }
    };
    // SAFETY: the closure runs between fork and exec, where only async-signal-safe
    // calls are allowed; it makes two system calls and does not allocate.
    unsafe { command.pre_exec(request) }
}

/// A child that is ended, by force if need be, when this value goes.
pub struct Guarded(Child);

/// Time between asking a child to end and forcing it.
const GRACE: Duration = Duration::from_millis(1000);

impl Guarded {
    /// Takes charge of a child.
    pub fn new(child: Child) -> Self {
        Self(child)
    }

    /// The child itself, for its pipes.
    pub fn child(&mut self) -> &mut Child {
        &mut self.0
    }

    /// Its process id.
    pub fn id(&self) -> u32 {
        self.0.id()
    }

    /// How the child ended, if it has.
    ///
    /// # Errors
    /// If the system cannot tell.
    pub fn ended(&mut self) -> io::Result<Option<ExitStatus>> {
        self.0.try_wait()
    }

    /// Whether the child is stopped, as by SIGSTOP.
    pub fn is_stopped(&self) -> bool {
        let Ok(id) = i32::try_from(self.0.id()) else {
            return false;
        };
        // Only a look: how the child ends is for `ended` to find out.
        let look = WaitPidFlag::WSTOPPED | WaitPidFlag::WNOHANG | WaitPidFlag::WNOWAIT;
        matches!(
            waitid(Id::Pid(Pid::from_raw(id)), look),
            Ok(WaitStatus::Stopped(..))
        )
    }

    /// Forces the child to end.
    pub fn kill(&mut self) {
        // Errors mean that it has just ended.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }

    /// Asks the child to end, waits a while, then forces it; how it ended.
    pub fn stop(&mut self) -> Option<ExitStatus> {
        if let Ok(Some(status)) = self.0.try_wait() {
            return Some(status);
        }
        if let Ok(id) = i32::try_from(self.0.id()) {
            // An error means that it has just ended.
            let _ = kill(Pid::from_raw(id), Signal::SIGTERM);
        }
        let asked = Instant::now();
        while asked.elapsed() < GRACE {
            if let Ok(Some(status)) = self.0.try_wait() {
                return Some(status);
            }
            if self.is_stopped() {
                // It cannot hear.
                break;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        self.kill();
        self.0.wait().ok()
    }
}

impl Drop for Guarded {
    fn drop(&mut self) {
        self.stop();
    }
}

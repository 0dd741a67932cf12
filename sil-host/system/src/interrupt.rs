//! Ctrl-C and requests to end, as a flag that loops look at, so that files and shared
//! memory are left tidy.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use nix::sys::signal::{SigHandler, Signal, signal};

/// Whether the process has been asked to end.
#[derive(Clone, Debug, Default)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Catches SIGINT, SIGTERM and SIGHUP from now on.
    ///
    /// # Errors
    /// If the handler cannot be set, or has been already.
    pub fn catch() -> Result<Self, ctrlc::Error> {
        let interrupt = Self::default();
        let flag = Arc::clone(&interrupt.0);
        ctrlc::set_handler(move || flag.store(true, Ordering::Relaxed))?;
        Ok(interrupt)
    }

    /// Ends the process with `exit_code` at SIGINT, SIGTERM or SIGHUP, after `farewell`. For
    /// work that has nothing to put in order.
    ///
    /// # Errors
    /// As [`Interrupt::catch`].
    pub fn exit(exit_code: u8, farewell: impl Fn() + Send + 'static) -> Result<(), ctrlc::Error> {
        ctrlc::set_handler(move || {
            farewell();
            std::process::exit(i32::from(exit_code));
        })
    }

    /// Asks for an end as a signal does.
    pub fn request(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether a signal has come.
    pub fn is_requested(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Makes a write beyond `ulimit -f` fail as one to a full disk does, instead of killing the
/// process without a word.
///
/// # Errors
/// If the system refuses.
#[allow(unsafe_code)]
pub fn ignore_file_size_limit() -> std::io::Result<()> {
    // SAFETY: ignoring a signal installs no handler that could run.
    unsafe { signal(Signal::SIGXFSZ, SigHandler::SigIgn) }?;
    Ok(())
}

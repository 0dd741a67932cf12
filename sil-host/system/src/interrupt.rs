//! Ctrl-C and requests to end, as a flag that loops look at, so that files and shared
//! memory are left tidy.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

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

    /// Whether a signal has come.
    pub fn is_requested(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

//! Ctrl-C and requests to end: as a flag that loops look at, so that files and shared memory
//! are left tidy, or as an orderly end for work that leaves nothing half-done.
//!
//! The handlers do nothing but what a signal handler may do. There is no thread that could
//! fail to start, or hear of a signal late.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};

use nix::libc::{_exit, STDERR_FILENO, c_int, write};
use nix::sys::signal::{SaFlags, SigAction, SigHandler, SigSet, Signal, sigaction};

/// Requests to end.
const REQUESTS: [Signal; 3] = [Signal::SIGINT, Signal::SIGTERM, Signal::SIGHUP];

/// A signal has come.
static SIGNALLED: AtomicBool = AtomicBool::new(false);
/// For [`exit_when_requested`].
static EXIT_CODE: AtomicU8 = AtomicU8::new(1);
const FAREWELL: &str = "error: interrupted\n";

/// Whether the process has been asked to end.
#[derive(Clone, Debug, Default)]
pub struct Interrupt {
    hears_signals: bool,
    requested: Arc<AtomicBool>,
}

impl Interrupt {
    /// Catches SIGINT, SIGTERM and SIGHUP from now on, unless they are ignored.
    ///
    /// # Errors
    /// If the system refuses.
    pub fn catch() -> io::Result<Self> {
        handle(note)?;
        Ok(Self {
            hears_signals: true,
            ..Self::default()
        })
    }

    /// Asks for an end as a signal does.
    pub fn request(&self) {
        self.requested.store(true, Ordering::Relaxed);
    }

    /// Whether a signal has come.
    pub fn is_requested(&self) -> bool {
        self.requested.load(Ordering::Relaxed)
            || self.hears_signals && SIGNALLED.load(Ordering::Relaxed)
    }
}

/// From now on SIGINT, SIGTERM and SIGHUP end the process at once with `code` and one
/// message, unless they are ignored. For work that has nothing to put in order.
///
/// # Errors
/// If the system refuses.
pub fn exit_when_requested(code: u8) -> io::Result<()> {
    EXIT_CODE.store(code, Ordering::Relaxed);
    handle(exit)
}

extern "C" fn note(_: c_int) {
    SIGNALLED.store(true, Ordering::Relaxed);
}

#[allow(unsafe_code)]
extern "C" fn exit(_: c_int) {
    // SAFETY: both calls may be made in a signal handler; the text lives for ever.
    unsafe {
        write(STDERR_FILENO, FAREWELL.as_ptr().cast(), FAREWELL.len());
        _exit(c_int::from(EXIT_CODE.load(Ordering::Relaxed)));
    }
}

fn handle(handler: extern "C" fn(c_int)) -> io::Result<()> {
    for signal in REQUESTS {
        let before = set(signal, SigHandler::Handler(handler))?;
        // As under nohup.
        if matches!(before.handler(), SigHandler::SigIgn) {
            set(signal, SigHandler::SigIgn)?;
        }
    }
    Ok(())
}

/// Makes a write beyond `ulimit -f` fail as one to a full disk does, instead of killing the
/// process without a word.
///
/// # Errors
/// If the system refuses.
pub fn ignore_file_size_limit() -> io::Result<()> {
    set(Signal::SIGXFSZ, SigHandler::SigIgn)?;
    Ok(())
}

#[allow(unsafe_code)]
fn set(signal: Signal, handler: SigHandler) -> io::Result<SigAction> {
    let action = SigAction::new(handler, SaFlags::SA_RESTART, SigSet::empty());
    // SAFETY: the handlers of this module make only calls that a signal handler may make.
    Ok(unsafe { sigaction(signal, &action) }?)
}

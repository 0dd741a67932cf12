//! Ctrl-C and requests to end: either a flag that loops check, so that files and shared memory are
//! left tidy, or an immediate exit for work that leaves nothing half-done.
//!
//! The handlers make only async-signal-safe calls. There is no thread that could fail to start or
//! react late.
//!
//! `signal-hook` would set the flag, but neither leaves ignored signals ignored, as under `nohup`, nor gives
//! children the default actions back.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};

use nix::libc::{_exit, STDERR_FILENO, c_int, write};
use nix::sys::signal::{SaFlags, SigAction, SigHandler, SigSet, Signal, sigaction};

/// Signals that request an end.
const REQUESTS: [Signal; 3] = [Signal::SIGINT, Signal::SIGTERM, Signal::SIGHUP];

/// Set when a signal arrives.
static SIGNALLED: AtomicBool = AtomicBool::new(false);
/// Exit code for [`exit_when_requested`].
static EXIT_CODE: AtomicU8 = AtomicU8::new(1);
const FAREWELL: &str = "error: interrupted\n";

/// Whether a request to end has been received.
#[derive(Clone, Debug, Default)]
pub struct Interrupt {
    hears_signals: bool,
    requested: Arc<AtomicBool>,
}

impl Interrupt {
    /// Catches SIGINT, SIGTERM and SIGHUP from now on, unless they are ignored.
    ///
    /// # Errors
    /// If the system refuses the handlers.
    pub fn catch() -> io::Result<Self> {
        handle(note)?;
        Ok(Self {
            hears_signals: true,
            ..Self::default()
        })
    }

    /// Requests an end, as a signal does.
    pub fn request(&self) {
        self.requested.store(true, Ordering::Relaxed);
    }

    /// Returns whether a signal has arrived.
    pub fn is_requested(&self) -> bool {
        self.requested.load(Ordering::Relaxed)
            || self.hears_signals && SIGNALLED.load(Ordering::Relaxed)
    }
}

/// Requests an end of this process from whoever watches an [`Interrupt`] for signals, as a signal does.
pub fn request() {
    note(0);
}

/// Makes SIGINT, SIGTERM and SIGHUP end the process at once with `code` and one message, unless
/// they are ignored. Use it for work that leaves nothing to clean up.
///
/// # Errors
/// If the system refuses the handlers.
pub fn exit_when_requested(code: u8) -> io::Result<()> {
    EXIT_CODE.store(code, Ordering::Relaxed);
    handle(exit)
}

extern "C" fn note(_: c_int) {
    SIGNALLED.store(true, Ordering::Relaxed);
}

#[allow(unsafe_code)]
extern "C" fn exit(_: c_int) {
    // SAFETY: both calls are async-signal-safe; the text is static.
    unsafe {
        write(STDERR_FILENO, FAREWELL.as_ptr().cast(), FAREWELL.len());
        _exit(c_int::from(EXIT_CODE.load(Ordering::Relaxed)));
    }
}

fn handle(handler: extern "C" fn(c_int)) -> io::Result<()> {
    for signal in REQUESTS {
        let before = set(signal, SigHandler::Handler(handler))?;
        // Ignored signals stay ignored, as under nohup.
        if matches!(before.handler(), SigHandler::SigIgn) {
            set(signal, SigHandler::SigIgn)?;
        }
    }
    Ok(())
}

/// Gives SIGINT, SIGTERM and SIGHUP their default action in this process and in the children that
/// it starts from now on. A shell's background jobs ignore SIGINT, and their children with them.
///
/// # Errors
/// If the system refuses the setting.
pub fn restore_default_actions() -> io::Result<()> {
    for signal in REQUESTS {
        set(signal, SigHandler::SigDfl)?;
    }
    Ok(())
}

/// Makes a write beyond `ulimit -f` fail like a write to a full disk, instead of killing the
/// process without a message.
///
/// # Errors
/// If the system refuses the setting.
pub fn ignore_file_size_limit() -> io::Result<()> {
    set(Signal::SIGXFSZ, SigHandler::SigIgn)?;
    Ok(())
}

#[allow(unsafe_code)]
fn set(signal: Signal, handler: SigHandler) -> io::Result<SigAction> {
    let action = SigAction::new(handler, SaFlags::SA_RESTART, SigSet::empty());
    // SAFETY: the handlers of this module make only async-signal-safe calls.
    Ok(unsafe { sigaction(signal, &action) }?)
}

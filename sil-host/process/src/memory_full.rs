//! A full `/dev/shm` ends the process with a message.
//!
//! A file in shared memory is allocated when it is written. If no memory is left, the kernel sends
//! SIGBUS to the writer, which by default ends it without a message. The write cannot be undone or
//! repeated, so the handler prints one line and ends the process.

use std::io;
use std::sync::atomic::{AtomicU8, Ordering};

use nix::libc::{_exit, STDERR_FILENO, c_int, write};
use nix::sys::signal::{SaFlags, SigAction, SigHandler, SigSet, Signal, sigaction};

static EXIT_CODE: AtomicU8 = AtomicU8::new(1);
const MESSAGE: &str = "error: shared memory is full: enlarge /dev/shm, or remove the files that \
                       `painleve doctor` lists\n";

/// Makes SIGBUS end the process with `code` and one message.
///
/// # Errors
/// If the system refuses the handler.
#[allow(unsafe_code)]
pub fn exit_when_shared_memory_is_full(code: u8) -> io::Result<()> {
    EXIT_CODE.store(code, Ordering::Relaxed);
    let action = SigAction::new(
        SigHandler::Handler(tell),
        SaFlags::SA_ONSTACK,
        SigSet::empty(),
    );
    // SAFETY: the handler makes only async-signal-safe calls.
    unsafe { sigaction(Signal::SIGBUS, &action) }?;
    Ok(())
}

#[allow(unsafe_code)]
extern "C" fn tell(_: c_int) {
    // SAFETY: both calls are async-signal-safe; the text is static.
    unsafe {
        write(STDERR_FILENO, MESSAGE.as_ptr().cast(), MESSAGE.len());
        _exit(c_int::from(EXIT_CODE.load(Ordering::Relaxed)));
    }
}

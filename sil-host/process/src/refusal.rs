//! What a user can do about a resource that the system refuses.

use std::error::Error;
use std::io;

use nix::errno::Errno;

/// Returns the remedy for a refusal by the system, as the end of a message; `other` for any other error.
pub fn remedy(error: &(dyn Error + 'static), other: &'static str) -> &'static str {
    let refusal = error.downcast_ref::<io::Error>();
    let refusal = refusal.and_then(io::Error::raw_os_error);
    match refusal.map(Errno::from_raw) {
        Some(Errno::EMFILE) => "; raise `ulimit -n`",
        Some(Errno::EFBIG) => "; raise `ulimit -f`",
        Some(Errno::EAGAIN) => "; end other processes, or raise `ulimit -u`",
        Some(Errno::ENOMEM) => "; end other programs, or raise `ulimit -v`",
        Some(Errno::ENOSPC | Errno::EDQUOT) => "; remove files from there",
        _ => error.source().map_or(other, |source| remedy(source, other)),
    }
}

//! Standard output and standard error, of which either may be closed or full.

use std::fmt::Display;
use std::io::{self, Write};

/// Writes a line to standard output.
///
/// # Errors
/// [`io::ErrorKind::BrokenPipe`] if the reader has closed the pipe; other errors if the line is
/// lost.
pub fn say(line: impl Display) -> io::Result<()> {
    let mut stdout = io::stdout();
    writeln!(stdout, "{line}")?;
    stdout.flush()
}

/// Writes a line to standard error. Errors are ignored: a full disk under its log must not end a
/// run.
pub fn warn(line: impl Display) {
    let _ = writeln!(io::stderr(), "{line}");
}

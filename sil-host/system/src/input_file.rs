//! Text files from outside, read within bounds.

use std::fs::OpenOptions;
use std::io::{self, Read};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;

use nix::libc::O_NONBLOCK;

/// The most that a text file of settings may hold, bytes. Real ones have a few thousand.
pub const MOST_BYTES: u64 = 16 << 20;

/// Reads a regular file that holds at most [`MOST_BYTES`]. A pipe or a device could hold the
/// process up, or give bytes without end.
///
/// # Errors
/// Those of the system, and [`io::ErrorKind::InvalidInput`] with the reason in words.
pub fn read(path: &Path) -> io::Result<String> {
    let refuse = |reason: String| Err(io::Error::new(io::ErrorKind::InvalidInput, reason));
    // Opening a pipe without a writer would wait for one.
    let file = OpenOptions::new()
        .read(true)
        .custom_flags(O_NONBLOCK)
        .open(path)?;
    if !file.metadata()?.is_file() {
        return refuse("it is not a regular file".into());
    }
    let mut text = String::new();
    file.take(MOST_BYTES + 1).read_to_string(&mut text)?;
    if text.len() as u64 > MOST_BYTES {
        return refuse(format!("it holds more than {MOST_BYTES} bytes"));
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nix::sys::stat::Mode;
    use nix::unistd::mkfifo;
    use std::fs::File;

    #[test]
    fn regular_files_are_read_and_nothing_else_is_waited_for() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scenario.toml");
        std::fs::write(&path, "name = \"é\"").unwrap();
        assert_eq!(read(&path).unwrap(), "name = \"é\"");
        let pipe = folder.path().join("pipe");
        mkfifo(&pipe, Mode::S_IRWXU).unwrap();
        for path in [&pipe, Path::new("/dev/zero"), folder.path()] {
            let error = read(path).unwrap_err().to_string();
            assert!(error.contains("not a regular file"), "{error}");
        }
        let sparse = folder.path().join("sparse");
        File::create(&sparse).unwrap().set_len(1 << 40).unwrap();
        let error = read(&sparse).unwrap_err().to_string();
        assert!(error.contains("more than"), "{error}");
    }
}

//! Reads text files of limited size.

use std::fs::OpenOptions;
use std::io::{self, Read};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;

use nix::libc::O_NONBLOCK;

/// Largest size of a settings file, bytes. Real ones have a few thousand.
pub const MOST_BYTES: u64 = 16 << 20;

/// Reads a regular file of at most [`MOST_BYTES`]. Pipes and devices are refused, because they
/// could block the process or never end.
///
/// # Errors
/// Those of the system, and [`io::ErrorKind::InvalidInput`] with the reason.
pub fn read(path: &Path) -> io::Result<String> {
    let refuse = |reason: String| Err(io::Error::new(io::ErrorKind::InvalidInput, reason));
    // Opening a pipe without a writer would block.
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
    fn regular_files_are_read_and_others_are_refused_without_blocking() {
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

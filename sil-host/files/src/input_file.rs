//! Opens input files: regular files only, of limited size.
//!
//! Every file opened here is remembered, so that no output of the same process replaces it.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fs::{File, Metadata, OpenOptions};
use std::io::{self, Read};
use std::os::fd::AsFd;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use nix::libc::O_NONBLOCK;

/// Largest size of a settings file, bytes. Real ones have a few thousand.
pub const MOST_BYTES: u64 = 16 << 20;

/// Largest size of a controller's image with its debug information, bytes. Real ones have ten million.
pub const MOST_IMAGE_BYTES: u64 = 256 << 20;

/// How files that are no scenario begin, what they are, and what takes them.
const KINDS: [(&[u8], &str); 8] = [
    (
        MCAP,
        "a record: `painleve export`, `compare` and `diff` read it",
    ),
    (
        b"time_s,plant.",
        "a table of ticks: `painleve compare` reads it after a record",
    ),
    (b"<svg", "a figure"),
    (b"<!doctype html", "a page for a browser"),
    (
        b"<?xml",
        "XML: `painleve arm` reads the arm of a URDF or an MJCF file",
    ),
    (b"<robot", "a URDF file: `painleve arm` reads its arm"),
    (b"<mujoco", "an MJCF file: `painleve arm` reads its arm"),
    (b"\x7fELF", "an image of a board: `--elf` takes it"),
];

/// How an MCAP file begins.
const MCAP: &[u8] = b"\x89MCAP0\r\n";

thread_local! {
    /// The contents that this thread has read in [`with_contents`], by path; `None` outside.
    static CONTENTS: RefCell<Option<BTreeMap<PathBuf, Vec<u8>>>> = const { RefCell::new(None) };
}

/// The files opened so far, by device and inode.
static OPENED: Mutex<BTreeMap<(u64, u64), PathBuf>> = Mutex::new(BTreeMap::new());

fn refused(reason: String) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, reason)
}

/// Opens a regular file with content. Pipes and devices are refused, because they could block the process or never end.
///
/// # Errors
/// Those of the system, and [`io::ErrorKind::InvalidInput`] with the reason.
pub fn open(path: &Path) -> io::Result<File> {
    // Opening a pipe without a writer would block.
    let file = OpenOptions::new()
        .read(true)
        .custom_flags(O_NONBLOCK)
        .open(path)?;
    let metadata = file.metadata()?;
    if !metadata.is_file() {
        return Err(refused("it is not a regular file".into()));
    }
    if metadata.len() == 0 {
        return Err(refused("it is empty".into()));
    }
    remember(&metadata, path);
    Ok(file)
}

/// Remembers the file behind standard input.
///
/// # Errors
/// Those of the system.
pub fn remember_standard_input() -> io::Result<()> {
    let input = File::from(io::stdin().as_fd().try_clone_to_owned()?);
    remember(&input.metadata()?, Path::new("standard input"));
    Ok(())
}

fn remember(file: &Metadata, path: &Path) {
    let mut opened = OPENED.lock().unwrap_or_else(PoisonError::into_inner);
    opened.insert((file.dev(), file.ino()), path.to_path_buf());
}

/// Returns the path under which this process has opened a file, if it has.
pub fn opened_as(file: &Metadata) -> Option<PathBuf> {
    let opened = OPENED.lock().unwrap_or_else(PoisonError::into_inner);
    opened.get(&(file.dev(), file.ino())).cloned()
}

/// Returns what `act` returns, and the content of every file that it reads on this thread: all that its result
/// depends on besides its arguments.
pub fn with_contents<T>(act: impl FnOnce() -> T) -> (T, BTreeMap<PathBuf, Vec<u8>>) {
    let outer = CONTENTS.replace(Some(BTreeMap::new()));
    let done = act();
    (done, CONTENTS.replace(outer).unwrap_or_default())
}

/// Returns what a file is, if it begins as one of those that painleve writes or reads elsewhere, and what takes it.
pub fn kind(path: &Path) -> Option<&'static str> {
    let mut head = Vec::new();
    open(path).ok()?.take(32).read_to_end(&mut head).ok()?;
    if head.starts_with(MCAP) && head.get(17..25) == Some(b"\x04\0\0\0ros2") {
        return Some("a ROS 2 bag, which ROS reads");
    }
    KINDS
        .iter()
        .find_map(|(start, kind)| head.starts_with(start).then_some(*kind))
}

/// Whether a file begins as records and ROS 2 bags do.
pub fn begins_as_mcap(path: &Path) -> bool {
    let mut head = [0; MCAP.len()];
    open(path).is_ok_and(|mut file| file.read_exact(&mut head).is_ok() && head == *MCAP)
}

/// Reads a regular file of at most `most_bytes`.
///
/// # Errors
/// As [`open`].
pub fn bytes(path: &Path, most_bytes: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open(path)?.take(most_bytes + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most_bytes {
        return Err(refused(format!("it holds more than {most_bytes} bytes")));
    }
    CONTENTS.with_borrow_mut(|contents| {
        if let Some(contents) = contents {
            contents.insert(path.to_path_buf(), bytes.clone());
        }
    });
    Ok(bytes)
}

/// Reads a text of at most [`MOST_BYTES`] from a regular file.
///
/// # Errors
/// As [`open`], and [`io::ErrorKind::InvalidData`] if it is not UTF-8.
pub fn read(path: &Path) -> io::Result<String> {
    text(bytes(path, MOST_BYTES)?)
}

fn text(bytes: Vec<u8>) -> io::Result<String> {
    String::from_utf8(bytes)
        .map_err(|_| io::Error::new(io::ErrorKind::InvalidData, "it is not text in UTF-8"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nix::sys::stat::Mode;
    use nix::unistd::mkfifo;

    #[test]
    fn what_is_read_is_known_with_its_content() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("friction.csv");
        std::fs::write(&path, "position_m,friction").unwrap();
        read(&path).unwrap();
        let (text, contents) = with_contents(|| read(&path).unwrap());
        assert_eq!(contents, BTreeMap::from([(path, text.into_bytes())]));
        assert_eq!(with_contents(|| ()).1, BTreeMap::new());
    }

    #[test]
    fn regular_files_are_read_and_others_are_refused_without_blocking() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scenario.toml");
        std::fs::write(&path, "name = \"é\"").unwrap();
        let metadata = std::fs::metadata(&path).unwrap();
        assert_eq!(opened_as(&metadata), None);
        assert_eq!(read(&path).unwrap(), "name = \"é\"");
        assert_eq!(opened_as(&metadata), Some(path));
        let binary = folder.path().join("binary");
        std::fs::write(&binary, b"\xff").unwrap();
        assert!(read(&binary).unwrap_err().to_string().contains("UTF-8"));
        let pipe = folder.path().join("pipe");
        mkfifo(&pipe, Mode::S_IRWXU).unwrap();
        for path in [&pipe, Path::new("/dev/zero"), folder.path()] {
            let error = read(path).unwrap_err().to_string();
            assert!(error.contains("not a regular file"), "{error}");
        }
        let empty = folder.path().join("empty");
        File::create(&empty).unwrap();
        assert_eq!(read(&empty).unwrap_err().to_string(), "it is empty");
        let sparse = folder.path().join("sparse");
        File::create(&sparse).unwrap().set_len(1 << 40).unwrap();
        let error = read(&sparse).unwrap_err().to_string();
        assert!(error.contains("more than"), "{error}");
    }
}

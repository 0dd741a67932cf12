//! Output files that appear whole or not at all.
//!
//! An [`AtomicFile`] is written under a temporary name beside its target.
//! [`commit`](AtomicFile::commit) gives it the target's name once the data is on the disk. If it is
//! dropped before that, it is removed, and an older file stays unchanged.
//!
//! The temporary file is locked while its process lives. The next file of the same name removes the
//! temporary files of killed processes. A symbolic link is kept; the file that it points to is
//! replaced.

use std::ffi::{OsStr, OsString};
use std::fs::{self, File, TryLockError};
use std::io::{self, Seek, SeekFrom, Write};
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

/// Failure to write an output file.
#[derive(Debug, thiserror::Error)]
pub enum AtomicFileError {
    /// The path is a folder, a device, or has no file name.
    #[error("`{path}` cannot be an output file: give the path of a regular file in a folder")]
    NotAFile {
        /// The requested path.
        path: PathBuf,
    },
    /// A parent folder does not exist and cannot be created.
    #[error(
        "cannot create the folder `{folder}` for `{path}`: {source}; choose a path that can be written"
    )]
    Folder {
        /// The requested path.
        path: PathBuf,
        /// Its folder.
        folder: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The file exists already, but a new one was requested.
    #[error("`{path}` already exists")]
    Exists {
        /// The requested path.
        path: PathBuf,
    },
    /// Another process is writing the file.
    #[error(
        "`{path}` is being written by another process: wait for its end or choose another path"
    )]
    Busy {
        /// The requested path.
        path: PathBuf,
    },
    /// The folder or its disk does not accept the file.
    #[error("cannot write `{path}`: {source}; choose a path that can be written and has space")]
    Write {
        /// The requested path.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
}

/// A file that receives its name when it is complete.
#[derive(Debug)]
pub struct AtomicFile {
    /// The path as given, for messages.
    path: PathBuf,
    folder: PathBuf,
    target: PathBuf,
    temporary: NamedTempFile,
    /// Whether an existing file must not be replaced.
    is_new: bool,
    /// Remaining bytes, for tests of a full disk.
    #[cfg(any(test, feature = "full-disk"))]
    pub room: usize,
}

impl AtomicFile {
    /// Opens a temporary file beside `path` and creates missing folders.
    ///
    /// # Errors
    /// [`AtomicFileError`] if `path` is something other than a regular file, or its folder cannot
    /// be created or written to.
    pub fn create(path: impl Into<PathBuf>) -> Result<Self, AtomicFileError> {
        let path = path.into();
        let Some((folder, name)) = place(&path) else {
            return Err(AtomicFileError::NotAFile { path });
        };
        if let Err(source) = create_folders(&folder) {
            return Err(AtomicFileError::Folder {
                path,
                folder,
                source,
            });
        }
        let opened = temporary(&folder, &name)
            .and_then(|temporary| Ok((fs::canonicalize(&folder)?.join(name), temporary)));
        match opened {
            Ok((target, temporary)) => Ok(Self {
                target,
                folder,
                path,
                temporary,
                is_new: false,
                #[cfg(any(test, feature = "full-disk"))]
                room: usize::MAX,
            }),
            Err(source) => Err(AtomicFileError::Write { path, source }),
        }
    }

    /// Checks that no other process is writing a file of this name. Two that start at the same moment may both
    /// find the other.
    ///
    /// # Errors
    /// [`AtomicFileError::Busy`].
    pub fn check_alone(&self) -> Result<(), AtomicFileError> {
        let name = self.target.file_name().unwrap_or_default();
        let is_written = |path: PathBuf| {
            path.file_name() != self.temporary.path().file_name()
                && File::open(path)
                    .is_ok_and(|file| matches!(file.try_lock(), Err(TryLockError::WouldBlock)))
        };
        if temporaries(&self.folder, name).any(is_written) {
            let path = self.path.clone();
            return Err(AtomicFileError::Busy { path });
        }
        Ok(())
    }

    /// Returns the final path of the file, as given.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the final path of the file, with symbolic links resolved.
    pub fn target(&self) -> &Path {
        &self.target
    }

    /// Writes the data to the disk and gives the file its name.
    ///
    /// # Errors
    /// [`AtomicFileError::Write`] if the disk is full or the name is not available; the file is
    /// then removed.
    pub fn commit(self) -> Result<(), AtomicFileError> {
        let Self {
            path,
            folder,
            target,
            temporary,
            is_new,
            ..
        } = self;
        let write = |source| AtomicFileError::Write {
            path: path.clone(),
            source,
        };
        temporary.as_file().sync_all().map_err(write)?;
        let named = if is_new {
            temporary.persist_noclobber(target)
        } else {
            temporary.persist(target)
        };
        named.map_err(|error| match error.error.kind() {
            io::ErrorKind::AlreadyExists if is_new => {
                AtomicFileError::Exists { path: path.clone() }
            }
            _ => write(error.error),
        })?;
        sync_folder(&folder).map_err(write)
    }

    /// Writes the data received up to now to the disk under a name that marks it as partial, for
    /// example `run.partial.mcap` for `run.mcap`, and returns that path. An older `run.mcap` stays
    /// unchanged.
    ///
    /// # Errors
    /// As [`AtomicFile::commit`].
    pub fn commit_partial(mut self) -> Result<PathBuf, AtomicFileError> {
        let rename = |path: &Path| {
            let extension = path.extension().unwrap_or_default().to_string_lossy();
            path.with_extension(format!("partial.{extension}"))
        };
        self.target = rename(&self.target);
        let path = rename(&self.path);
        self.commit()?;
        Ok(path)
    }

    // The plain file: `NamedTempFile` would put its temporary name into errors.
    fn file(&self) -> &File {
        self.temporary.as_file()
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        #[cfg(any(test, feature = "full-disk"))]
        match self.room.checked_sub(bytes.len()) {
            Some(room) => self.room = room,
            None => return Err(io::ErrorKind::StorageFull.into()),
        }
        self.file().write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file().flush()
    }
}

impl Seek for AtomicFile {
    fn seek(&mut self, position: SeekFrom) -> io::Result<u64> {
        self.file().seek(position)
    }
}

/// Returns the folder and the name of a future file, with symbolic links resolved. `None` if the
/// path is something other than a regular file: renaming onto a folder would fail only at the end,
/// and renaming onto a device would replace the device.
fn place(path: &Path) -> Option<(PathBuf, OsString)> {
    let followed = match fs::symlink_metadata(path) {
        Ok(metadata) if metadata.is_symlink() => fs::canonicalize(path).ok()?,
        _ => path.to_path_buf(),
    };
    if fs::metadata(&followed).is_ok_and(|metadata| !metadata.is_file()) {
        return None;
    }
    let name = followed.file_name()?.to_os_string();
    let folder = followed.parent()?;
    let folder = if folder.as_os_str().is_empty() {
        Path::new(".")
    } else {
        folder
    };
    Some((folder.to_path_buf(), name))
}

/// Creates a locked temporary file, after removing those of dead processes.
fn temporary(folder: &Path, name: &OsStr) -> io::Result<NamedTempFile> {
    remove_abandoned(folder, name);
    let prefix = prefix(name);
    loop {
        let temporary = tempfile::Builder::new()
            .prefix(&prefix)
            .suffix(SUFFIX)
            // Temporary files are private by default; an output file must not be.
            .permissions(fs::Permissions::from_mode(0o666))
            .tempfile_in(folder)?;
        // On a file system without locks, abandoned files are not removed either.
        let _ = temporary.as_file().try_lock();
        // Before it was locked, another process may have removed it as abandoned.
        let own = temporary.as_file().metadata()?.ino();
        if fs::symlink_metadata(temporary.path()).is_ok_and(|there| there.ino() == own) {
            return Ok(temporary);
        }
    }
}

const SUFFIX: &str = ".part";

/// Returns the start of the names of a file's temporary files.
fn prefix(name: &OsStr) -> String {
    format!(".{}.", name.to_string_lossy())
}

/// Returns the temporary files of a file, of all processes.
fn temporaries(folder: &Path, name: &OsStr) -> impl Iterator<Item = PathBuf> {
    let prefix = prefix(name);
    let is_temporary = move |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let random = name
            .strip_prefix(prefix.as_str())
            .and_then(|rest| rest.strip_suffix(SUFFIX));
        // Otherwise it belongs to a longer name.
        random.is_some_and(|random| !random.contains('.'))
    };
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries.map(|entry| entry.path()).filter(is_temporary)
}

fn remove_abandoned(folder: &Path, name: &OsStr) {
    for path in temporaries(folder, name) {
        if File::open(&path).is_ok_and(|file| file.try_lock().is_ok()) {
            let _ = fs::remove_file(path);
        }
    }
}

/// Creates a folder and the missing ones above it, and writes their names to the disk.
fn create_folders(folder: &Path) -> io::Result<()> {
    let missing: Vec<_> = folder.ancestors().take_while(|it| !it.exists()).collect();
    fs::create_dir_all(folder)?;
    for created in missing {
        match created.parent() {
            Some(above) if above.as_os_str().is_empty() => sync_folder(Path::new("."))?,
            Some(above) => sync_folder(above)?,
            None => {}
        }
    }
    Ok(())
}

/// Writes the new directory entry to the disk.
fn sync_folder(folder: &Path) -> io::Result<()> {
    match File::open(folder).and_then(|folder| folder.sync_all()) {
        // Some file systems do not support this.
        Err(error) if error.kind() == io::ErrorKind::InvalidInput => Ok(()),
        other => other,
    }
}

/// Writes a whole new file; fails if the path exists. If several processes write at once, one
/// succeeds.
///
/// # Errors
/// [`AtomicFileError::Exists`], and those of [`AtomicFile`].
pub fn write_new(path: impl Into<PathBuf>, contents: &[u8]) -> Result<(), AtomicFileError> {
    let mut file = AtomicFile::create(path)?;
    file.is_new = true;
    finish(file, contents)
}

/// Writes a whole file.
///
/// # Errors
/// Those of [`AtomicFile`]; the file is then removed.
pub fn write(path: impl Into<PathBuf>, contents: &[u8]) -> Result<(), AtomicFileError> {
    finish(AtomicFile::create(path)?, contents)
}

fn finish(mut file: AtomicFile, contents: &[u8]) -> Result<(), AtomicFileError> {
    match file.write_all(contents) {
        Ok(()) => file.commit(),
        Err(source) => Err(AtomicFileError::Write {
            path: file.path,
            source,
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect()
    }

    #[test]
    fn a_file_appears_complete_in_new_folders_and_replaces_the_old_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a/b/run.svg");
        write(&path, b"first").unwrap();
        let mut file = AtomicFile::create(&path).unwrap();
        file.write_all(b"second").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"first");
        file.commit().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"second");
        assert_eq!(names(path.parent().unwrap()), ["run.svg"]);
    }

    #[test]
    fn a_file_dropped_before_commit_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let mut file = AtomicFile::create(folder.path().join("run.svg")).unwrap();
        file.write_all(b"half").unwrap();
        drop(file);
        assert_eq!(names(folder.path()), [""; 0]);
    }

    #[test]
    fn files_of_killed_processes_are_removed_and_files_being_written_are_kept() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.svg");
        let writing = AtomicFile::create(&path).unwrap();
        fs::write(folder.path().join(".run.svg.killed.part"), "half").unwrap();
        fs::write(folder.path().join(".other.svg.killed.part"), "half").unwrap();
        write(&path, b"next").unwrap();
        writing.commit().unwrap();
        let mut left = names(folder.path());
        left.sort();
        assert_eq!(left, [".other.svg.killed.part", "run.svg"]);
    }

    #[test]
    fn a_file_that_is_being_written_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        let first = AtomicFile::create(&path).unwrap();
        first.check_alone().unwrap();
        // A longer name is another file.
        let longer = AtomicFile::create(folder.path().join("a.csv.gz")).unwrap();
        first.check_alone().unwrap();
        longer.check_alone().unwrap();
        let second = AtomicFile::create(&path).unwrap();
        let message = second.check_alone().unwrap_err().to_string();
        assert!(message.contains("a.csv` is being written"), "{message}");
        first.commit().unwrap();
        second.check_alone().unwrap();
    }

    #[test]
    fn a_symbolic_link_is_kept_and_its_target_is_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let (file, link) = (folder.path().join("file"), folder.path().join("link"));
        fs::write(&file, "old").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        write(&link, b"new").unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read(&file).unwrap(), b"new");
        // A link that leads nowhere cannot be resolved.
        fs::remove_file(&file).unwrap();
        assert!(matches!(
            AtomicFile::create(&link),
            Err(AtomicFileError::NotAFile { .. })
        ));
    }

    #[test]
    fn a_partial_file_is_kept_under_a_partial_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.mcap");
        fs::write(&path, "old").unwrap();
        let mut file = AtomicFile::create(&path).unwrap();
        file.write_all(b"half").unwrap();
        let partial = file.commit_partial().unwrap();
        assert_eq!(partial, folder.path().join("run.partial.mcap"));
        assert_eq!(fs::read(partial).unwrap(), b"half");
        assert_eq!(fs::read(path).unwrap(), b"old");
    }

    #[test]
    fn paths_that_cannot_be_files_are_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        for path in [
            folder.path(),
            Path::new(""),
            Path::new("/"),
            Path::new(".."),
        ] {
            let error = AtomicFile::create(path).unwrap_err();
            assert!(matches!(error, AtomicFileError::NotAFile { .. }), "{error}");
        }
        let file = folder.path().join("file");
        fs::write(&file, "").unwrap();
        let error = write(file.join("run.svg"), b"").unwrap_err().to_string();
        assert!(error.contains("cannot create the folder"), "{error}");
        assert!(error.contains("file/run.svg"), "{error}");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn devices_are_refused_and_an_unwritable_folder_is_reported_with_the_name_of_the_file() {
        assert!(matches!(
            AtomicFile::create("/dev/null"),
            Err(AtomicFileError::NotAFile { .. })
        ));
        // No user may create files there, not even root.
        let error = write("/proc/run.svg", b"").unwrap_err().to_string();
        assert!(error.contains("cannot write `/proc/run.svg`"), "{error}");
    }

    #[cfg(unix)]
    #[test]
    fn an_output_file_has_the_permissions_of_the_umask() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let plain = folder.path().join("plain");
        fs::write(&plain, "").unwrap();
        let path = folder.path().join("run.svg");
        write(&path, b"").unwrap();
        let mode = |path| fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(path), mode(plain));
    }
}

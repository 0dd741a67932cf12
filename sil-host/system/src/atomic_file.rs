//! Output files that appear whole or not at all.
//!
//! An [`AtomicFile`] is written under a temporary name beside its target and takes
//! the target's name in [`commit`](AtomicFile::commit), after the data is on the
//! disk. Dropped before that, it leaves nothing; an older file stays as it was.
//!
//! The temporary file is locked as long as its process lives. What killed processes have
//! left, the next file of the same name removes. A symbolic link stays: the file that it
//! names is replaced.

use std::ffi::{OsStr, OsString};
use std::fs::{self, File};
use std::io::{self, Seek, SeekFrom, Write};
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

/// Why an output file could not be written.
#[derive(Debug, thiserror::Error)]
pub enum AtomicFileError {
    /// The path is a folder, a device, or has no file name.
    #[error("`{path}` cannot be an output file: give the path of a regular file in a folder")]
    NotAFile {
        /// The path asked for.
        path: PathBuf,
    },
    /// A folder on the way does not exist and cannot be made.
    #[error(
        "cannot create the folder `{folder}` for `{path}`: {source}; choose a path that can be written"
    )]
    Folder {
        /// The path asked for.
        path: PathBuf,
        /// Its folder.
        folder: PathBuf,
        /// The operating system's reason.
        source: io::Error,
    },
    /// There is such a file already, and it was to be a new one.
    #[error("`{path}` is there already")]
    Exists {
        /// The path asked for.
        path: PathBuf,
    },
    /// The folder, or the disk under it, does not take the file.
    #[error("cannot write `{path}`: {source}; choose a path that can be written and has space")]
    Write {
        /// The path asked for.
        path: PathBuf,
        /// The operating system's reason.
        source: io::Error,
    },
}

/// A file that gets its name when it is complete.
#[derive(Debug)]
pub struct AtomicFile {
    /// As it was given, for messages.
    path: PathBuf,
    folder: PathBuf,
    target: PathBuf,
    temporary: NamedTempFile,
    /// No file may be replaced.
    is_new: bool,
    /// Bytes that still fit, for tests of a disk that fills up.
    #[cfg(any(test, feature = "full-disk"))]
    pub room: usize,
}

impl AtomicFile {
    /// Opens a temporary file beside `path`, making missing folders.
    ///
    /// # Errors
    /// [`AtomicFileError`] if `path` is something other than a regular file, or its
    /// folder cannot be made or written.
    pub fn create(path: impl Into<PathBuf>) -> Result<Self, AtomicFileError> {
        let path = path.into();
        let Some((folder, name)) = place(&path) else {
            return Err(AtomicFileError::NotAFile { path });
        };
        if let Err(source) = fs::create_dir_all(&folder) {
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

    /// The name the file will have, as it was given.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The name the file will have, symbolic links followed.
    pub fn target(&self) -> &Path {
        &self.target
    }

    /// Brings the data to the disk and gives the file its name.
    ///
    /// # Errors
    /// [`AtomicFileError::Write`] if the disk is full or the name cannot be taken;
    /// nothing is left then.
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

    /// Brings what there is of the data to the disk, under a name that says so:
    /// `run.partial.mcap` for `run.mcap`, which stays as it was. That name is returned.
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

/// The folder and the name of a file to be; a symbolic link is followed. `None` if something
/// else than a regular file is there: renaming onto a folder would fail only at the end, and
/// onto a device would replace the device.
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

/// A locked temporary file, after those of processes that have died are removed.
fn temporary(folder: &Path, name: &OsStr) -> io::Result<NamedTempFile> {
    let prefix = format!(".{}.", name.to_string_lossy());
    remove_abandoned(folder, &prefix);
    loop {
        let temporary = tempfile::Builder::new()
            .prefix(&prefix)
            .suffix(SUFFIX)
            // Temporary files are private by default; an output file is not.
            .permissions(fs::Permissions::from_mode(0o666))
            .tempfile_in(folder)?;
        // Where files cannot be locked they are not removed either.
        let _ = temporary.as_file().try_lock();
        // Another process may have taken it for an abandoned one before it was locked.
        let own = temporary.as_file().metadata()?.ino();
        if fs::symlink_metadata(temporary.path()).is_ok_and(|there| there.ino() == own) {
            return Ok(temporary);
        }
    }
}

const SUFFIX: &str = ".part";

fn remove_abandoned(folder: &Path, prefix: &str) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        if name.starts_with(prefix)
            && name.ends_with(SUFFIX)
            && File::open(entry.path()).is_ok_and(|file| file.try_lock().is_ok())
        {
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// Brings a new name to the disk, too.
fn sync_folder(folder: &Path) -> io::Result<()> {
    match File::open(folder).and_then(|folder| folder.sync_all()) {
        // Not every file system can.
        Err(error) if error.kind() == io::ErrorKind::InvalidInput => Ok(()),
        other => other,
    }
}

/// Writes a whole file in one go, unless there is one of this name. Of several writers at
/// once one succeeds.
///
/// # Errors
/// [`AtomicFileError::Exists`], and those of [`AtomicFile`].
pub fn write_new(path: impl Into<PathBuf>, contents: &[u8]) -> Result<(), AtomicFileError> {
    let mut file = AtomicFile::create(path)?;
    file.is_new = true;
    finish(file, contents)
}

/// Writes a whole file in one go.
///
/// # Errors
/// Those of [`AtomicFile`]; nothing is left then.
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
    fn what_a_killed_process_has_left_is_removed_and_what_is_being_written_is_not() {
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
    fn a_symbolic_link_stays_and_what_it_names_is_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let (file, link) = (folder.path().join("file"), folder.path().join("link"));
        fs::write(&file, "old").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        write(&link, b"new").unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read(&file).unwrap(), b"new");
        // One that leads nowhere cannot be followed.
        fs::remove_file(&file).unwrap();
        assert!(matches!(
            AtomicFile::create(&link),
            Err(AtomicFileError::NotAFile { .. })
        ));
    }

    #[test]
    fn part_of_a_file_is_kept_under_a_name_that_says_so() {
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
    fn devices_are_refused_and_an_unwritable_folder_is_told_by_the_file_s_own_name() {
        assert!(matches!(
            AtomicFile::create("/dev/null"),
            Err(AtomicFileError::NotAFile { .. })
        ));
        // Nobody may make files there, not even root.
        let error = write("/proc/run.svg", b"").unwrap_err().to_string();
        assert!(error.contains("cannot write `/proc/run.svg`"), "{error}");
    }

    #[cfg(unix)]
    #[test]
    fn others_may_read_an_output_file_as_far_as_the_umask_lets_them() {
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

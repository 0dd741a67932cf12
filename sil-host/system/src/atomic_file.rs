//! Output files that appear whole or not at all.
//!
//! An [`AtomicFile`] is written under a temporary name beside its target and takes
//! the target's name in [`commit`](AtomicFile::commit), after the data is on the
//! disk. Dropped before that, it leaves nothing; an older file stays as it was.

use std::fs::{self, File};
use std::io::{self, Seek, SeekFrom, Write};
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
    path: PathBuf,
    temporary: NamedTempFile,
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
        // Renaming onto a folder would fail only at the end, and onto a device
        // would replace the device.
        let taken = fs::metadata(&path).is_ok_and(|metadata| !metadata.is_file());
        let (Some(name), Some(folder), false) = (path.file_name(), path.parent(), taken) else {
            return Err(AtomicFileError::NotAFile { path });
        };
        let folder = if folder.as_os_str().is_empty() {
            Path::new(".")
        } else {
            folder
        };
        if let Err(source) = fs::create_dir_all(folder) {
            let folder = folder.to_path_buf();
            return Err(AtomicFileError::Folder {
                path,
                folder,
                source,
            });
        }
        let prefix = format!(".{}.", name.to_string_lossy());
        let mut builder = tempfile::Builder::new();
        builder.prefix(&prefix).suffix(".part");
        // Temporary files are private by default; an output file is not.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        match builder.tempfile_in(folder) {
            Ok(temporary) => Ok(Self {
                path,
                temporary,
                #[cfg(any(test, feature = "full-disk"))]
                room: usize::MAX,
            }),
            Err(source) => Err(AtomicFileError::Write { path, source }),
        }
    }

    /// The name the file will have.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Brings the data to the disk and gives the file its name.
    ///
    /// # Errors
    /// [`AtomicFileError::Write`] if the disk is full or the name cannot be taken;
    /// nothing is left then.
    pub fn commit(self) -> Result<(), AtomicFileError> {
        let Self {
            path, temporary, ..
        } = self;
        let committed = match temporary.as_file().sync_all() {
            Ok(()) => temporary.persist(&path).map_err(|error| error.error),
            Err(error) => Err(error),
        };
        match committed {
            Ok(_) => Ok(()),
            Err(source) => Err(AtomicFileError::Write { path, source }),
        }
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

/// Writes a whole file in one go.
///
/// # Errors
/// Those of [`AtomicFile`]; nothing is left then.
pub fn write(path: impl Into<PathBuf>, contents: &[u8]) -> Result<(), AtomicFileError> {
    let mut file = AtomicFile::create(path)?;
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

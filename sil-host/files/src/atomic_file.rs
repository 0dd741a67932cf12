//! Output files that appear whole or not at all.
//!
//! An [`AtomicFile`] is written under a temporary name beside its target.
//! [`commit`](AtomicFile::commit) gives it the target's name once the data is on the disk. If it is
//! dropped before that, it is removed, and an older file stays unchanged.
//!
//! The temporary file is locked while its process lives. The next file of the same name removes the
//! temporary files of killed processes. A symbolic link of the user's own is kept; the file that it points to is
//! replaced. Links of other users are refused.

use std::ffi::{OsStr, OsString};
use std::fs::{self, File, TryLockError};
use std::hash::{BuildHasher, RandomState};
use std::io::{self, Seek, SeekFrom, Write};
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

use nix::dir::Dir;
use nix::errno::Errno;
use nix::fcntl::{AtFlags, OFlag, openat, renameat};
use nix::sys::stat::Mode;
use nix::unistd::{UnlinkatFlags, linkat, unlinkat};

use crate::output_place::{OutputPlace, PlaceError, sync};

/// Failure to write an output file.
#[derive(Debug, thiserror::Error)]
pub enum AtomicFileError {
    /// The path is a folder, a device or a pipe, or has no file name.
    #[error("`{path}` cannot be an output file: give the path of a regular file in a folder")]
    NotAFile {
        /// The requested path.
        path: PathBuf,
    },
    /// A symbolic link on the way leads nowhere.
    #[error(
        "cannot write `{path}`: `{link}` is a symbolic link that leads to no file; remove it or create what it \
         names"
    )]
    Dangling {
        /// The requested path.
        path: PathBuf,
        /// The link.
        link: PathBuf,
    },
    /// Another user's symbolic link would choose the file that is replaced.
    #[error(
        "cannot write `{path}`: `{link}` is a symbolic link of another user, who may want a file of yours \
         replaced; choose another path"
    )]
    ForeignLink {
        /// The requested path.
        path: PathBuf,
        /// The link.
        link: PathBuf,
    },
    /// A folder on the way cannot be opened.
    #[error(
        "cannot open the folder `{folder}` to write `{path}`: {source}; choose a path that can be written"
    )]
    ClosedFolder {
        /// The requested path.
        path: PathBuf,
        /// The folder.
        folder: PathBuf,
        /// Error of the operating system.
        source: io::Error,
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

impl AtomicFileError {
    fn of_place(path: PathBuf, error: PlaceError) -> Self {
        match error {
            PlaceError::NotAFile => Self::NotAFile { path },
            PlaceError::Dangling(link) => Self::Dangling { path, link },
            PlaceError::Foreign(link) => Self::ForeignLink { path, link },
            PlaceError::Folder(folder, source) => Self::Folder {
                path,
                folder,
                source,
            },
            PlaceError::Closed(folder, source) => Self::ClosedFolder {
                path,
                folder,
                source,
            },
        }
    }
}

/// A file that receives its name when it is complete.
#[derive(Debug)]
pub struct AtomicFile {
    /// The path as given, for messages.
    path: PathBuf,
    place: OutputPlace,
    /// The file under its temporary name.
    file: File,
    temporary: OsString,
    /// Whether an existing file must not be replaced.
    is_new: bool,
    /// Bytes that still fit: a test of a full disk lowers it. A feature for it would compile every crate twice for the tests.
    pub room: usize,
}

impl AtomicFile {
    /// Opens a temporary file beside `path` and creates missing folders.
    ///
    /// # Errors
    /// [`AtomicFileError`] if `path` is something other than a regular file, leads through a symbolic link of
    /// another user, or its folder cannot be created or written to.
    pub fn create(path: impl Into<PathBuf>) -> Result<Self, AtomicFileError> {
        let path = path.into();
        let folders = path.ancestors().skip(1).map(Path::to_path_buf);
        let missing: Vec<PathBuf> = folders.take_while(|folder| !folder.exists()).collect();
        Self::in_folder(path).inspect_err(|_| {
            for folder in missing {
                // Of a refused file nothing is left.
                let _ = fs::remove_dir(folder);
            }
        })
    }

    fn in_folder(path: PathBuf) -> Result<Self, AtomicFileError> {
        let place = match OutputPlace::find(&path) {
            Ok(place) => place,
            Err(error) => return Err(AtomicFileError::of_place(path, error)),
        };
        match temporary(&place) {
            Ok((file, temporary)) => Ok(Self {
                path,
                place,
                file,
                temporary,
                is_new: false,
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
        let is_written = |name: OsString| {
            name != self.temporary
                && existing(&self.place, &name)
                    .is_ok_and(|file| matches!(file.try_lock(), Err(TryLockError::WouldBlock)))
        };
        if temporaries(&self.place).into_iter().any(is_written) {
            let path = self.path.clone();
            return Err(AtomicFileError::Busy { path });
        }
        Ok(())
    }

    /// Returns the final path of the file, as given.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes the data to the disk.
    fn sync(&self) -> Result<(), AtomicFileError> {
        self.file.sync_all().map_err(|source| self.error(source))
    }

    fn error(&self, source: impl Into<io::Error>) -> AtomicFileError {
        AtomicFileError::Write {
            path: self.path.clone(),
            source: source.into(),
        }
    }

    /// Writes the data to the disk and gives the file its name.
    ///
    /// # Errors
    /// [`AtomicFileError::Write`] if the disk is full or the name is not available; the file is
    /// then removed. If nothing fails but the sync of its folder, it has its name already.
    pub fn commit(self) -> Result<(), AtomicFileError> {
        self.sync()?;
        let OutputPlace { folder, name, .. } = &self.place;
        let temporary = self.temporary.as_os_str();
        let named = if self.is_new {
            // The temporary name is removed with `self`.
            match linkat(
                folder,
                temporary,
                folder,
                name.as_os_str(),
                AtFlags::empty(),
            ) {
                // A file system without hard links.
                Err(Errno::EPERM | Errno::EOPNOTSUPP) if existing(&self.place, name).is_err() => {
                    renameat(folder, temporary, folder, name.as_os_str())
                }
                linked => linked,
            }
        } else {
            renameat(folder, temporary, folder, name.as_os_str())
        };
        named.map_err(|error| match error {
            Errno::EEXIST if self.is_new => AtomicFileError::Exists {
                path: self.path.clone(),
            },
            _ => self.error(error),
        })?;
        sync(folder).map_err(|error| self.error(error))
    }

    /// Writes the data received up to now to the disk under a name that marks it as partial, for
    /// example `run.partial.mcap` for `run.mcap`, and returns that path. An older `run.mcap` stays
    /// unchanged.
    ///
    /// # Errors
    /// As [`AtomicFile::commit`].
    pub fn commit_partial(mut self) -> Result<PathBuf, AtomicFileError> {
        let place = &mut self.place;
        let mut name = PathBuf::from(std::mem::take(&mut place.name));
        let mut extension = OsString::from("partial");
        if let Some(own) = name.extension() {
            extension.push(".");
            extension.push(own);
        }
        name.set_extension(extension);
        let path = place.folder_path.join(&name);
        place.name = name.into();
        self.commit()?;
        Ok(path)
    }
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        // Fails if the file has received its name.
        let _ = remove(&self.place, &self.temporary);
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self.room.checked_sub(bytes.len()) {
            Some(room) => self.room = room,
            None => return Err(io::ErrorKind::StorageFull.into()),
        }
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Seek for AtomicFile {
    fn seek(&mut self, position: SeekFrom) -> io::Result<u64> {
        self.file.seek(position)
    }
}

/// Creates a locked temporary file, after removing those of dead processes.
fn temporary(place: &OutputPlace) -> io::Result<(File, OsString)> {
    for name in temporaries(place) {
        if existing(place, &name).is_ok_and(|file| file.try_lock().is_ok()) {
            let _ = remove(place, &name);
        }
    }
    let flags = OFlag::O_RDWR | OFlag::O_CREAT | OFlag::O_EXCL | OFlag::O_CLOEXEC;
    let mode = Mode::from_bits_truncate(0o666);
    let mut attempt = 0_u32;
    loop {
        attempt += 1;
        // `RandomState` is random for each process, and for each call.
        let random = RandomState::new().hash_one(attempt);
        let mut name = prefix(&place.name);
        name.push(format!("{random:016x}{SUFFIX}"));
        let file = match openat(&place.folder, name.as_os_str(), flags, mode) {
            Err(Errno::EEXIST) => continue,
            file => File::from(file?),
        };
        if lock_new(place, &file, &name) {
            return Ok((file, name));
        }
        let _ = remove(place, &name);
    }
}

/// Locks a new temporary file. Returns `false` if another process, to which it looked abandoned until then, has locked or
/// removed it.
fn lock_new(place: &OutputPlace, file: &File, name: &OsStr) -> bool {
    // On a file system without locks, abandoned files are not removed either.
    !matches!(file.try_lock(), Err(TryLockError::WouldBlock)) && existing(place, name).is_ok()
}

const SUFFIX: &str = ".part";

/// Returns the start of the names of a file's temporary files.
fn prefix(name: &OsStr) -> OsString {
    let mut prefix = OsString::from(".");
    prefix.push(name);
    prefix.push(".");
    prefix
}

/// Opens a file of the folder, but no link.
fn existing(place: &OutputPlace, name: &OsStr) -> Result<File, Errno> {
    let flags = OFlag::O_RDONLY | OFlag::O_NOFOLLOW | OFlag::O_NONBLOCK | OFlag::O_CLOEXEC;
    openat(&place.folder, name, flags, Mode::empty()).map(File::from)
}

fn remove(place: &OutputPlace, name: &OsStr) -> Result<(), Errno> {
    unlinkat(&place.folder, name, UnlinkatFlags::NoRemoveDir)
}

/// Returns the names of a file's temporary files, of all processes.
fn temporaries(place: &OutputPlace) -> Vec<OsString> {
    let prefix = prefix(&place.name);
    let is_temporary = |name: &[u8]| {
        name.strip_prefix(prefix.as_bytes())
            .and_then(|rest| rest.strip_suffix(SUFFIX.as_bytes()))
            // Otherwise it belongs to a longer name, or is a file of the user.
            .is_some_and(|random| random.len() == 16 && random.iter().all(u8::is_ascii_hexdigit))
    };
    let flags = OFlag::O_RDONLY | OFlag::O_DIRECTORY | OFlag::O_CLOEXEC;
    let Ok(mut folder) = Dir::openat(&place.folder, ".", flags, Mode::empty()) else {
        return Vec::new();
    };
    let names = folder.iter().flatten();
    names
        .map(|entry| OsStr::from_bytes(entry.file_name().to_bytes()).to_owned())
        .filter(|name| is_temporary(name.as_bytes()))
        .collect()
}

/// Gives several complete files their names, after the data of all is on the disk: a full disk leaves none of
/// them.
///
/// # Errors
/// As [`AtomicFile::commit`]; files that already have their names keep them.
pub fn commit_all(files: Vec<AtomicFile>) -> Result<(), AtomicFileError> {
    files.iter().try_for_each(AtomicFile::sync)?;
    files.into_iter().try_for_each(AtomicFile::commit)
}

/// Writes a whole new file; fails if the path exists. If several processes write at once, one
/// succeeds.
///
/// # Errors
/// [`AtomicFileError::Exists`], and those of [`AtomicFile`].
pub fn write_new(path: impl Into<PathBuf>, contents: &[u8]) -> Result<(), AtomicFileError> {
    let mut file = prepare(path, contents)?;
    file.is_new = true;
    file.commit()
}

/// Writes a whole file.
///
/// # Errors
/// Those of [`AtomicFile`]; the file is then removed.
pub fn write(path: impl Into<PathBuf>, contents: &[u8]) -> Result<(), AtomicFileError> {
    prepare(path, contents)?.commit()
}

/// Writes a whole file that receives its name later, with [`commit_all`].
///
/// # Errors
/// Those of [`AtomicFile`]; the file is then removed.
pub fn prepare(path: impl Into<PathBuf>, contents: &[u8]) -> Result<AtomicFile, AtomicFileError> {
    let mut file = AtomicFile::create(path)?;
    match file.write_all(contents) {
        Ok(()) => Ok(file),
        Err(source) => Err(file.error(source)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nix::unistd::{Uid, geteuid, setfsuid};
    use std::os::fd::AsRawFd;
    use std::os::unix::fs::{PermissionsExt, lchown, symlink};

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
        let kept = [
            ".other.svg.0123456789abcdef.part",
            ".run.svg.first.part",
            ".run.svg.sixteen-letters!.part",
        ];
        for name in [".run.svg.0123456789abcdef.part"].iter().chain(&kept) {
            fs::write(folder.path().join(name), "half").unwrap();
        }
        write(&path, b"next").unwrap();
        writing.commit().unwrap();
        let mut left = names(folder.path());
        left.sort();
        assert_eq!(left, [&kept[..], &["run.svg"]].concat());
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
        symlink(&file, &link).unwrap();
        write(&link, b"new").unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read(&file).unwrap(), b"new");
        let partial = AtomicFile::create(&link).unwrap().commit_partial().unwrap();
        assert_eq!(partial, folder.path().join("file.partial"));
        // Links may also lead to a folder, up and down, and to further links.
        let (deep, there) = (folder.path().join("deep/er"), folder.path().join("there"));
        fs::create_dir_all(&deep).unwrap();
        symlink("deep/../deep/er", &there).unwrap();
        symlink("../../link", deep.join("back")).unwrap();
        write(there.join("new"), b"").unwrap();
        assert!(deep.join("new").exists());
        write(there.join("back"), b"newer").unwrap();
        assert_eq!(fs::read(&file).unwrap(), b"newer");
    }

    #[test]
    fn links_that_lead_nowhere_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let (lost, turn) = (folder.path().join("lost"), folder.path().join("turn"));
        symlink("nowhere/deep", &lost).unwrap();
        symlink("turn", &turn).unwrap();
        for path in [lost.clone(), lost.join("run.mcap")] {
            let error = AtomicFile::create(path).unwrap_err();
            assert!(
                matches!(&error, AtomicFileError::Dangling { link, .. } if *link == lost),
                "{error}"
            );
            assert!(error.to_string().contains("leads to no file"), "{error}");
        }
        let error = AtomicFile::create(&turn).unwrap_err().to_string();
        assert!(error.contains("symbolic links"), "{error}");
        assert_eq!(names(folder.path()).len(), 2);
    }

    #[test]
    fn a_path_that_ends_like_a_folder_is_none_of_a_file() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["new/", "new//", "new/.", "new/deeper/"] {
            let error = AtomicFile::create(folder.path().join(name)).unwrap_err();
            let message = error.to_string();
            assert!(message.contains("cannot be an output file"), "{message}");
        }
        assert_eq!(names(folder.path()), [""; 0]);
    }

    #[test]
    fn a_refused_file_leaves_no_folder_made_for_it() {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join("there")).unwrap();
        let too_long = format!("there/new/deeper/{}.csv", "x".repeat(300));
        AtomicFile::create(folder.path().join(too_long)).unwrap_err();
        assert_eq!(names(&folder.path().join("there")), [""; 0]);
    }

    #[test]
    fn a_folder_that_must_not_be_read_takes_files_and_folders() {
        const NOBODY: u32 = 23_002;
        let folder = tempfile::tempdir().unwrap();
        let drop_box = folder.path().join("drop-box");
        fs::create_dir(&drop_box).unwrap();
        fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o755)).unwrap();
        fs::set_permissions(&drop_box, fs::Permissions::from_mode(0o300)).unwrap();
        let is_root = geteuid().is_root();
        if is_root {
            lchown(&drop_box, Some(NOBODY), Some(NOBODY)).unwrap();
        }
        let writing = || {
            if is_root {
                // Root may read everything; this thread alone becomes another user.
                nix::unistd::setfsuid(NOBODY.into());
            }
            assert!(fs::read_dir(&drop_box).is_err());
            for name in ["a.csv", "new/deeper/a.csv"] {
                write(drop_box.join(name), b"whole").unwrap();
                assert_eq!(fs::read(drop_box.join(name)).unwrap(), b"whole");
            }
        };
        std::thread::scope(|scope| scope.spawn(writing).join()).unwrap();
        fs::set_permissions(&drop_box, fs::Permissions::from_mode(0o700)).unwrap();
    }

    /// A shared folder in which everybody may put links, as in `/tmp`.
    #[test]
    fn links_of_other_users_are_refused_where_they_choose_the_file() {
        const STRANGER: u32 = 23_002;
        if !geteuid().is_root() {
            eprintln!("SKIPPED: only root can make a link of another user");
            return;
        }
        let folder = tempfile::tempdir().unwrap();
        let (home, shared) = (folder.path().join("home"), folder.path().join("shared"));
        fs::create_dir(&home).unwrap();
        fs::create_dir(&shared).unwrap();
        let secret = home.join("secret");
        fs::write(&secret, "mine").unwrap();
        let link = |name: &str, target: &Path, owner: u32| {
            let path = shared.join(name);
            symlink(target, &path).unwrap();
            lchown(&path, Some(owner), Some(owner)).unwrap();
            path
        };
        let file = link("run.mcap", &secret, STRANGER);
        let up = link("up", &home, STRANGER);
        let own = link("own", &home, 0);
        // A link of one's own to the link of another user.
        let detour = home.join("detour");
        symlink(&file, &detour).unwrap();
        for mode in [0o755, 0o1777] {
            fs::set_permissions(&shared, fs::Permissions::from_mode(mode)).unwrap();
            for path in [&file, &detour] {
                let error = AtomicFile::create(path).unwrap_err();
                assert!(
                    matches!(error, AtomicFileError::ForeignLink { .. }),
                    "{error}"
                );
                assert!(error.to_string().contains("shared/run.mcap"), "{error}");
            }
            let by_folder = AtomicFile::create(up.join("secret"));
            assert_eq!(by_folder.is_ok(), mode == 0o755, "{by_folder:?}");
            AtomicFile::create(own.join("secret")).unwrap();
        }
        assert_eq!(fs::read(&secret).unwrap(), b"mine");
        assert_eq!(names(&home).len(), 2);
    }

    /// Between the opening of a file and its commit, its folder is exchanged.
    #[test]
    fn a_file_stays_in_the_folder_that_was_opened() {
        let folder = tempfile::tempdir().unwrap();
        let (out, moved) = (folder.path().join("out"), folder.path().join("moved"));
        let other = folder.path().join("other");
        fs::create_dir(&other).unwrap();
        let file = AtomicFile::create(out.join("run.mcap")).unwrap();
        fs::rename(&out, &moved).unwrap();
        symlink(&other, &out).unwrap();
        file.commit().unwrap();
        assert_eq!(names(&moved), ["run.mcap"]);
        assert_eq!(names(&other), [""; 0]);
    }

    #[test]
    fn several_files_appear_together() {
        let folder = tempfile::tempdir().unwrap();
        let paths = ["a", "b"].map(|name| folder.path().join(name));
        let files = paths.iter().map(|path| prepare(path, b"x").unwrap());
        commit_all(files.collect()).unwrap();
        let mut found = names(folder.path());
        found.sort();
        assert_eq!(found, ["a", "b"]);
    }

    #[test]
    fn a_new_file_that_another_process_has_locked_or_removed_is_not_used() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new");
        let place = OutputPlace::find(&path).unwrap();
        let file = File::create(&path).unwrap();
        let looked_at = File::open(&path).unwrap();
        looked_at.lock().unwrap();
        assert!(!lock_new(&place, &file, OsStr::new("new")));
        drop(looked_at);
        assert!(lock_new(&place, &file, OsStr::new("new")));
        fs::remove_file(&path).unwrap();
        assert!(!lock_new(&place, &file, OsStr::new("new")));
    }

    #[test]
    fn names_that_are_not_text_are_names_too() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(OsStr::from_bytes(b"a\xff.mcap"));
        let first = AtomicFile::create(&path).unwrap();
        let second = AtomicFile::create(folder.path().join(OsStr::from_bytes(b"a\xfe.mcap")));
        second.unwrap().check_alone().unwrap();
        first.commit().unwrap();
        assert!(path.exists());
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

    #[test]
    fn a_folder_without_permission_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let mode = |path: &Path, mode| {
            fs::set_permissions(path, fs::Permissions::from_mode(mode)).unwrap();
        };
        mode(folder.path(), 0o755);
        let closed = folder.path().join("closed");
        fs::create_dir(&closed).unwrap();
        mode(&closed, 0);
        let path = closed.join("run.mcap");
        let refusal = std::thread::spawn(move || {
            // Root may open it; this thread is another user's.
            setfsuid(Uid::from_raw(65534));
            AtomicFile::create(&path).unwrap_err().to_string()
        });
        let expected = format!("cannot open the folder `{}` to write", closed.display());
        let refusal = refusal.join().unwrap();
        assert!(refusal.starts_with(&expected), "{refusal}");
        mode(&closed, 0o700);
    }

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

    #[test]
    fn an_open_pipe_is_no_file_and_its_link_not_to_be_removed() {
        let folder = tempfile::tempdir().unwrap();
        let (reader, _writer) = io::pipe().unwrap();
        let pipe = PathBuf::from(format!("/proc/self/fd/{}", reader.as_raw_fd()));
        let link = folder.path().join("link");
        symlink(&pipe, &link).unwrap();
        for path in [pipe, link] {
            let error = AtomicFile::create(path).unwrap_err();
            assert!(matches!(error, AtomicFileError::NotAFile { .. }), "{error}");
        }
    }

    #[test]
    fn an_output_file_has_the_permissions_of_the_umask() {
        let folder = tempfile::tempdir().unwrap();
        let plain = folder.path().join("plain");
        fs::write(&plain, "").unwrap();
        let path = folder.path().join("run.svg");
        write(&path, b"").unwrap();
        let mode = |path| fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(path), mode(plain));
    }
}

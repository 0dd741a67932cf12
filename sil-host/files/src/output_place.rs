//! The folder and name of an output file.
//!
//! The path is followed one name at a time with `openat`, and the folder stays open: whoever exchanges a name
//! afterwards changes nothing. Links of other users are not followed where they could choose the file that is
//! replaced: at the end of a path, and in folders that everybody may write to.

use std::ffi::{OsStr, OsString};
use std::fs::File;
use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::ffi::OsStrExt;
use std::path::{Component, Path, PathBuf};

use nix::errno::Errno;
use nix::fcntl::{AT_FDCWD, OFlag, openat, readlinkat};
use nix::libc::{S_IFDIR, S_IFLNK, S_IFMT, S_IFREG, S_IWOTH};
use nix::sys::stat::{FileStat, Mode, fstat, mkdirat};
use nix::unistd::Uid;

/// Links in one path, as many as the kernel follows.
const MOST_LINKS: usize = 40;

/// Why a path has no place for an output file.
#[derive(Debug)]
pub(crate) enum PlaceError {
    /// It is a folder, a device or a pipe, or has no file name.
    NotAFile,
    /// This link leads to nothing.
    Dangling(PathBuf),
    /// This link belongs to another user.
    Foreign(PathBuf),
    /// This folder cannot be created.
    Folder(PathBuf, io::Error),
    /// This folder cannot be opened.
    Closed(PathBuf, io::Error),
}

/// Where an output file goes.
#[derive(Debug)]
pub(crate) struct OutputPlace {
    /// The opened folder.
    pub folder: File,
    /// The name in it, which no link has.
    pub name: OsString,
    /// The folder's path after all links, for messages.
    pub folder_path: PathBuf,
}

impl OutputPlace {
    /// Follows a path and creates its missing folders.
    pub fn find(path: &Path) -> Result<Self, PlaceError> {
        // Whoever gives `-` expects standard output.
        if path.file_name().is_none() || path == Path::new("-") || names_a_folder(path) {
            return Err(PlaceError::NotAFile);
        }
        let mut walk = Walk::new(path)?;
        let name = walk.file_name()?;
        let folder = walk.readable()?;
        Ok(Self {
            folder,
            name,
            folder_path: walk.path,
        })
    }
}

/// What a name in a folder leads to.
enum Entry {
    Missing,
    Folder(OwnedFd),
    Link { target: PathBuf, is_own: bool },
    File,
    Other,
}

/// A path on its way to the last folder.
struct Walk {
    folder: OwnedFd,
    path: PathBuf,
    /// The names that follow, the next one last.
    names: Vec<OsString>,
    /// The first link that is being followed, and how many names come after its target.
    link: Option<(PathBuf, usize)>,
    links: usize,
}

impl Walk {
    fn new(path: &Path) -> Result<Self, PlaceError> {
        let mut walk = Self {
            folder: start(".")?,
            path: PathBuf::new(),
            names: Vec::new(),
            link: None,
            links: 0,
        };
        walk.follow(path)?;
        Ok(walk)
    }

    /// Continues with a path relative to the present folder.
    fn follow(&mut self, path: &Path) -> Result<(), PlaceError> {
        for component in path.components().rev() {
            match component {
                Component::RootDir => {
                    self.folder = start("/")?;
                    self.path = PathBuf::from("/");
                }
                Component::CurDir | Component::Prefix(_) => {}
                Component::ParentDir | Component::Normal(_) => {
                    self.names.push(component.as_os_str().to_owned());
                }
            }
        }
        Ok(())
    }

    /// Goes to the last folder and returns the name of the file in it.
    fn file_name(&mut self) -> Result<OsString, PlaceError> {
        while let Some(name) = self.names.pop() {
            let is_last = self.names.is_empty();
            let path = self.path.join(&name);
            let refuse = |error: Errno| PlaceError::Folder(path.clone(), error.into());
            self.link = (self.link.take()).filter(|(_, after)| self.names.len() >= *after);
            let entry = self.entry(&name).map_err(|error| match error {
                Errno::EACCES => self.closed(error),
                _ => refuse(error),
            });
            match entry? {
                Entry::Link { target, is_own } => {
                    self.links += 1;
                    if self.links > MOST_LINKS {
                        return Err(refuse(Errno::ELOOP));
                    }
                    let chooses_the_file = self.link.as_ref().map_or(is_last, |link| link.1 == 0);
                    if !is_own && (chooses_the_file || self.is_open_to_all().map_err(refuse)?) {
                        return Err(PlaceError::Foreign(path));
                    }
                    self.link.get_or_insert((path, self.names.len()));
                    self.follow(&target)?;
                }
                Entry::Folder(_) | Entry::Other if is_last => return Err(PlaceError::NotAFile),
                Entry::Folder(folder) => {
                    self.folder = folder;
                    self.path = path;
                }
                Entry::Missing if self.link.is_some() => {
                    let link = self.link.take().map_or(path, |(link, _)| link);
                    // The kernel follows its own links, such as those to open pipes, to what no name leads to.
                    return Err(if link.exists() {
                        PlaceError::NotAFile
                    } else {
                        PlaceError::Dangling(link)
                    });
                }
                Entry::File | Entry::Missing if is_last => return Ok(name),
                Entry::Missing => {
                    self.create(&name).map_err(refuse)?;
                    // Whatever is there now is looked at like everything else.
                    self.names.push(name);
                }
                Entry::File | Entry::Other => return Err(refuse(Errno::ENOTDIR)),
            }
        }
        // The path ended with a link to a folder.
        Err(PlaceError::NotAFile)
    }

    /// Looks at a name without following it.
    fn entry(&self, name: &OsStr) -> Result<Entry, Errno> {
        let look = |more| {
            let flags = OFlag::O_PATH | OFlag::O_NOFOLLOW | OFlag::O_CLOEXEC | more;
            openat(&self.folder, name, flags, Mode::empty())
        };
        // With O_DIRECTORY an automatic mount takes place.
        match look(OFlag::O_DIRECTORY) {
            Ok(folder) => return Ok(Entry::Folder(folder)),
            Err(Errno::ENOENT) => return Ok(Entry::Missing),
            Err(Errno::ENOTDIR | Errno::ELOOP) => {}
            Err(error) => return Err(error),
        }
        let found = match look(OFlag::empty()) {
            Err(Errno::ENOENT) => return Ok(Entry::Missing),
            found => found?,
        };
        let status = fstat(&found)?;
        Ok(match kind(&status) {
            S_IFLNK => Entry::Link {
                target: readlinkat(&found, "")?.into(),
                // A link of root needs no trust: root may write everywhere.
                is_own: status.st_uid == 0 || status.st_uid == Uid::effective().as_raw(),
            },
            S_IFREG => Entry::File,
            S_IFDIR => Entry::Folder(found),
            _ => Entry::Other,
        })
    }

    /// Returns whether everybody may put links into the present folder.
    fn is_open_to_all(&self) -> Result<bool, Errno> {
        Ok(fstat(&self.folder)?.st_mode & S_IWOTH != 0)
    }

    /// Creates a folder and writes its name to the disk.
    fn create(&self, name: &OsStr) -> Result<(), Errno> {
        match mkdirat(&self.folder, name, Mode::from_bits_truncate(0o777)) {
            // Another process was faster.
            Ok(()) | Err(Errno::EEXIST) => {}
            Err(error) => return Err(error),
        }
        sync(&opened(&self.folder)?)
    }

    /// Returns the present folder, opened for reading its names if it may be read.
    fn readable(&self) -> Result<File, PlaceError> {
        opened(&self.folder).map_err(|error| self.closed(error))
    }

    /// Returns the error of the present folder, which cannot be opened.
    fn closed(&self, error: Errno) -> PlaceError {
        let is_start = self.path.as_os_str().is_empty();
        let path = if is_start { Path::new(".") } else { &self.path };
        PlaceError::Closed(path.into(), error.into())
    }
}

/// Whether a path ends like that of a folder, which its components do not show.
fn names_a_folder(path: &Path) -> bool {
    let path = path.as_os_str().as_bytes();
    path.ends_with(b"/") || path.ends_with(b"/.")
}

/// Opens the folder in which a path starts.
fn start(path: &str) -> Result<OwnedFd, PlaceError> {
    let flags = OFlag::O_PATH | OFlag::O_DIRECTORY | OFlag::O_CLOEXEC;
    openat(AT_FDCWD, path, flags, Mode::empty())
        .map_err(|error| PlaceError::Closed(path.into(), error.into()))
}

fn opened(folder: &impl AsFd) -> Result<File, Errno> {
    let open = |access| {
        let flags = access | OFlag::O_DIRECTORY | OFlag::O_CLOEXEC;
        openat(folder, ".", flags, Mode::empty()).map(File::from)
    };
    match open(OFlag::O_RDONLY) {
        // Files can be written into a folder whose names must not be read.
        Err(Errno::EACCES) => open(OFlag::O_PATH),
        opened => opened,
    }
}

fn kind(status: &FileStat) -> u32 {
    status.st_mode & S_IFMT
}

/// Writes the names in a folder to the disk.
pub(crate) fn sync(folder: &File) -> Result<(), Errno> {
    match nix::unistd::fsync(folder) {
        // Some file systems do not support this, nor does a folder that must not be read.
        Err(Errno::EINVAL | Errno::EBADF) => Ok(()),
        other => other,
    }
}

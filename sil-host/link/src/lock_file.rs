//! The lock file of a bus or of a run: one byte for each role, locked as long as its holder lives.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::os::unix::fs::{FileExt, MetadataExt, OpenOptionsExt};
use std::path::Path;

use nix::errno::Errno;
use nix::fcntl::{FcntlArg, OFlag, fcntl};
use nix::libc::{F_RDLCK, F_UNLCK, F_WRLCK, SEEK_SET, c_short, flock};

/// Bytes reserved for a process id in the lock file, including its line break.
const NUMBER_WIDTH: usize = 11;

/// Role of a process on a bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    Plant,
    Controller,
}

impl Role {
    pub(super) fn byte(self) -> i64 {
        match self {
            Self::Plant => 1,
            Self::Controller => 2,
        }
    }

    /// Returns the role of the other end.
    pub(super) fn peer(self) -> Self {
        match self {
            Self::Plant => Self::Controller,
            Self::Controller => Self::Plant,
        }
    }
}

/// The open lock file of a bus.
#[derive(Debug)]
pub(super) struct LockFile(File);

impl LockFile {
    pub(super) fn open(path: &Path, create: bool) -> io::Result<Self> {
        OpenOptions::new()
            .read(true)
            .write(true)
            .create(create)
            .mode(0o600)
            .custom_flags(OFlag::O_NOFOLLOW.bits())
            .open(path)
            .map(Self)
    }

    /// Returns the file, for its contents.
    pub(super) fn file(&self) -> &File {
        &self.0
    }

    /// Returns another handle to the same open file; both share its locks.
    pub(super) fn share(&self) -> io::Result<Self> {
        self.0.try_clone().map(Self)
    }

    /// Returns whether a process with this role is on the bus. If the system cannot say, the answer
    /// is yes; the silence limit still applies.
    pub(super) fn is_held(&self, role: Role) -> bool {
        let mut asked = byte_lock(role.byte(), F_RDLCK);
        match fcntl(&self.0, FcntlArg::F_OFD_GETLK(&mut asked)) {
            Ok(_) => asked.l_type != F_UNLCK as c_short,
            Err(_) => true,
        }
    }

    /// Returns whether a process of either role holds its lock.
    pub(super) fn is_used(&self) -> bool {
        self.is_held(Role::Plant) || self.is_held(Role::Controller)
    }

    /// Takes the lock of a role; returns `false` if another process holds it.
    pub(super) fn try_hold(&self, role: Role) -> io::Result<bool> {
        self.try_lock(role.byte())
    }

    /// Takes a lock; returns `false` if another process holds it.
    pub(super) fn try_lock(&self, byte: i64) -> io::Result<bool> {
        match fcntl(&self.0, FcntlArg::F_OFD_SETLK(&byte_lock(byte, F_WRLCK))) {
            Ok(_) => Ok(true),
            Err(Errno::EAGAIN | Errno::EACCES) => Ok(false),
            Err(error) => Err(error.into()),
        }
    }

    pub(super) fn unlock(&self, byte: i64) {
        // Closing the file has the same effect, so an error here can be ignored.
        let _ = fcntl(&self.0, FcntlArg::F_OFD_SETLK(&byte_lock(byte, F_UNLCK)));
    }

    /// Returns whether the file still has its name; its folder may have been removed.
    pub(super) fn is_at(&self, path: &Path) -> bool {
        match (self.0.metadata(), fs::symlink_metadata(path)) {
            (Ok(own), Ok(there)) => own.ino() == there.ino() && own.dev() == there.dev(),
            _ => false,
        }
    }

    /// Records this process as the holder of a byte, for messages only.
    pub(super) fn sign(&self, byte: i64) {
        let line = format!("{:>1$}\n", std::process::id(), NUMBER_WIDTH - 1);
        let at = byte.unsigned_abs() * NUMBER_WIDTH as u64;
        let _ = self.0.write_at(line.as_bytes(), at);
    }

    /// Returns the id of the process that last took a byte.
    pub(super) fn signed(&self, byte: i64) -> Option<u32> {
        let mut line = [0; NUMBER_WIDTH];
        let at = byte.unsigned_abs() * NUMBER_WIDTH as u64;
        self.0.read_exact_at(&mut line, at).ok()?;
        std::str::from_utf8(&line).ok()?.trim().parse().ok()
    }
}

fn byte_lock(byte: i64, kind: i32) -> flock {
    flock {
        l_type: kind as c_short,
        l_whence: SEEK_SET as c_short,
        l_start: byte,
        l_len: 1,
        l_pid: 0,
    }
}

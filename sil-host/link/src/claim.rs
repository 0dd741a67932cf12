//! Records which processes are on a bus, with locks that the kernel releases when their holder
//! dies.
//!
//! Every bus has a folder with one file, `lock`, whose first bytes are locked:
//!
//! | byte | locked                                                     |
//! |------|------------------------------------------------------------|
//! | 0    | briefly, by a process that changes the folder's contents   |
//! | 1    | by the plant, as long as it is on the bus                  |
//! | 2    | by the controller, as long as it is on the bus             |
//!
//! The locks belong to the open file (`F_OFD_SETLK`). They end with the process, however it ends,
//! and another process can test them without taking them. The last process to leave a bus removes
//! the bus's folder and shared memory. The next start removes whatever killed processes left
//! behind.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use super::lock_file::{LockFile, Role};
use super::place::{Place, make_private};
use super::run_files::RunFiles;
use super::{BusName, LinkError};

const LOCK: &str = "lock";
/// Longest wait for another process that changes the folder; a change normally takes milliseconds.
const GATE_PATIENCE: Duration = Duration::from_millis(1000);
const GATE_POLL: Duration = Duration::from_millis(1);

const GATE: i64 = 0;

/// A bus as seen in the file system.
#[derive(Clone, Debug)]
pub(super) struct Bus {
    pub(super) name: BusName,
    pub(super) place: Place,
}

impl Bus {
    pub(super) fn folder(&self) -> PathBuf {
        self.place.folder.join(self.name.as_str())
    }

    fn lock_path(&self) -> PathBuf {
        self.folder().join(LOCK)
    }

    fn refuse(&self, error: io::Error) -> LinkError {
        LinkError::Folder {
            folder: self.folder(),
            source: error.into(),
        }
    }

    /// Opens the lock file without taking a lock; `None` if the bus has never been used.
    pub(super) fn look(&self) -> Option<LockFile> {
        LockFile::open(&self.lock_path(), false).ok()
    }

    /// Opens the lock file and waits for permission to change the folder.
    fn enter(&self) -> Result<Gate, LinkError> {
        let folder = self.folder();
        let mut waited = Duration::ZERO;
        loop {
            make_private(&folder)?;
            let file = match LockFile::open(&self.lock_path(), true) {
                Ok(file) => file,
                // The last process on the bus has just left and removed the folder.
                Err(error) if error.kind() == io::ErrorKind::NotFound => continue,
                Err(error) => return Err(self.refuse(error)),
            };
            while !file.try_lock(GATE).map_err(|error| self.refuse(error))? {
                if waited >= GATE_PATIENCE {
                    return Err(LinkError::Held {
                        bus: self.name.clone(),
                        process: file.signed(GATE),
                    });
                }
                waited += GATE_POLL;
                std::thread::sleep(GATE_POLL);
            }
            file.sign(GATE);
            if file.is_at(&self.lock_path()) {
                return Ok(Gate(file));
            }
        }
    }

    /// Takes a role on the bus, after removing what killed processes left there.
    ///
    /// # Errors
    /// [`LinkError::Folder`] if the folder cannot be used; [`LinkError::Held`] if another process
    /// keeps it locked.
    pub(super) fn claim(&self, role: Role) -> Result<Result<Claim, Taken>, LinkError> {
        let gate = self.enter()?;
        if gate.0.is_held(role) {
            return Ok(Err(Taken::ByAnother));
        }
        if role == Role::Plant {
            // A controller must notice that its plant has gone before another plant takes over.
            if gate.0.is_held(Role::Controller) {
                return Ok(Err(Taken::ByEarlierRun));
            }
            RunFiles::remove_all(&self.folder(), &self.place)
                .map_err(|error| self.refuse(error))?;
        }
        let refuse = |error| self.refuse(error);
        if !gate.0.try_lock(role.byte()).map_err(refuse)? {
            return Ok(Err(Taken::ByAnother));
        }
        gate.0.sign(role.byte());
        let file = gate.0.share().map_err(refuse)?;
        drop(gate);
        Ok(Ok(Claim {
            bus: self.clone(),
            role,
            file,
        }))
    }

    /// Removes all files of the bus if no process is on it. The next start removes whatever cannot
    /// be removed now.
    pub(super) fn remove_if_dead(&self) {
        let Some(file) = self.look() else {
            // A process was killed before it had created the lock file.
            let _ = fs::remove_dir(self.folder());
            return;
        };
        // Test without taking a lock first, so that a stopped process cannot block a bus in use.
        if file.is_used() || !matches!(file.try_lock(GATE), Ok(true)) {
            return;
        }
        file.sign(GATE);
        if file.is_at(&self.lock_path()) && !file.is_used() {
            // One rename frees the name, so that no other process has to wait any longer.
            let away = self.place.folder.join(away_name());
            if fs::rename(self.folder(), &away).is_ok() {
                file.unlock(GATE);
                remove_away(&away, &self.place);
            }
        }
    }
}

/// First character of the names of folders that are being removed; no bus name begins with it.
const AWAY: char = '.';

/// Returns an unused name for a folder that is to be removed.
fn away_name() -> String {
    format!("{AWAY}{}", BusName::unique())
}

fn remove_away(folder: &Path, place: &Place) {
    if RunFiles::remove_all(folder, place).is_ok() {
        let _ = fs::remove_dir_all(folder);
    }
}

/// Permission to change the folder's contents, held until dropped.
struct Gate(LockFile);

impl Drop for Gate {
    fn drop(&mut self) {
        self.0.unlock(GATE);
    }
}

/// Why a role is not available now.
#[derive(Debug)]
pub(super) enum Taken {
    /// A live process holds it.
    ByAnother,
    /// The controller of an earlier run has not left yet.
    ByEarlierRun,
}

/// A role on a bus, held until dropped. The last process to drop its claim removes the bus.
#[derive(Debug)]
pub(super) struct Claim {
    bus: Bus,
    role: Role,
    file: LockFile,
}

impl Claim {
    pub(super) fn bus(&self) -> &Bus {
        &self.bus
    }

    pub(super) fn role(&self) -> Role {
        self.role
    }

    /// Returns whether the other end's process is on the bus.
    pub(super) fn peer_is_alive(&self) -> bool {
        self.file.is_held(self.role.peer())
    }

    /// Returns the lock file for another thread of this process.
    pub(super) fn share(&self) -> io::Result<LockFile> {
        self.file.share()
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        self.file.unlock(self.role.byte());
        self.bus.remove_if_dead();
    }
}

/// Removes what killed processes left on any bus of this place.
pub(super) fn remove_dead(place: &Place) {
    for entry in fs::read_dir(&place.folder).into_iter().flatten().flatten() {
        if entry.file_name().to_string_lossy().starts_with(AWAY) {
            // The process that began the removal may have been killed; a second attempt at the same
            // time does no harm.
            remove_away(&entry.path(), place);
        } else if let Some(name) = entry
            .file_name()
            .to_str()
            .and_then(|name| name.parse().ok())
        {
            let place = place.clone();
            Bus { name, place }.remove_if_dead();
        }
    }
}

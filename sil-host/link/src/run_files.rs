//! The files of one run on a bus, used once by one plant and one controller.
//!
//! iceoryx2 lets many processes share services, and lets the survivors repair what a killed process
//! left half-made. That repair fails at many points (see [`RunFiles::remove_half_made`]), so here
//! no process shares anything that a killed process has touched. Each run has its own folder, and
//! its own prefix for everything that iceoryx2 creates. If a controller dies while it joins, the
//! plant creates all of it anew under another name.
//!
//! | file in `<bus>/<run>/` | made                                                  |
//! |------------------------|-------------------------------------------------------|
//! | `ready`                | by the plant, when any controller may join            |
//! | `ready-<pair>`         | instead, when only the one of its pair may            |
//! | `joined`               | by the controller, before it touches anything         |
//! | `answering`            | by the controller, when it is ready for frames        |
//! | `nodes/`, `services/`  | by iceoryx2, with its segments in shared memory       |
//!
//! The first of the run's files in shared memory is `<prefix>lock`. Plant and controller hold
//! a lock on it for as long as they use the run. Locks are visible to every process that sees
//! the file, whatever PID namespace, container or runtime folder it has, so that segments
//! whose folder is out of sight can still be identified as dead or alive (`survey`).

use std::collections::BTreeSet;
use std::fs::{self, OpenOptions};
use std::io::{self, Write};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use iceoryx2::prelude::{Config, FileName, Path as IceoryxPath, SemanticString};
use nix::errno::Errno;
use nix::fcntl::posix_fallocate;

use super::lock_file::{LockFile, Role};
use super::place::{Place, SHARED_MEMORY};
use super::{FolderError, LinkError, Pair};

/// Name of this program's own controllers.
pub(super) const OWN_CONTROLLER: &str = "painleve";

const READY: &str = "ready";
const JOINED: &str = "joined";
const ANSWERING: &str = "answering";
/// End of the name of the file in shared memory on which the users of a run hold locks.
const LOCK: &str = "lock";
/// Longest wait for a repair that removes the lock file. It takes milliseconds.
const REPAIR_PATIENCE: Duration = Duration::from_secs(1);
/// Most that iceoryx2 adds to a run's folder and prefix: `/nodes/`, 30 digits, `/`, a hash of 40 digits, `.service_tag`.
const LONGEST_ENDING: usize = 90;
/// Length of a run's random name in letters and digits: 71 bits, which cannot be guessed.
const NAME_LENGTH: usize = 12;

/// Folder and prefix of one run.
#[derive(Clone, Debug)]
pub(super) struct RunFiles {
    folder: PathBuf,
    prefix: String,
}

impl RunFiles {
    /// Creates the folder of a new run. Only the plant calls it.
    pub(super) fn create(bus_folder: &Path, place: &Place) -> io::Result<Self> {
        let folder = tempfile::Builder::new()
            .prefix("")
            .rand_bytes(NAME_LENGTH)
            .tempdir_in(bus_folder)?
            .keep();
        Ok(Self::at(folder, place))
    }

    /// Returns the run on the bus that waits for a controller of this pair, if there is one.
    pub(super) fn ready(bus_folder: &Path, place: &Place, pair: Option<Pair>) -> Option<Self> {
        let runs = all(bus_folder, place).unwrap_or_default();
        let ready = ready_for(pair);
        runs.into_iter()
            .find(|run| run.has(&ready) && !run.has(JOINED))
    }

    fn at(folder: PathBuf, place: &Place) -> Self {
        let name = folder.file_name().unwrap_or_default().to_string_lossy();
        let prefix = format!("{}{name}_", place.prefix);
        Self { folder, prefix }
    }

    /// Returns the settings of iceoryx2: its defaults, regardless of any configuration file of the
    /// user, with this run's folder and prefix, and without its own search for dead processes.
    pub(super) fn config(&self) -> Result<Config, LinkError> {
        let refuse = || LinkError::Folder {
            folder: self.folder.clone(),
            source: FolderError::UnusablePath,
        };
        let longest = self.folder.as_os_str().len() + self.prefix.len() + LONGEST_ENDING;
        if longest > IceoryxPath::max_len() {
            return Err(refuse());
        }
        let mut config = Config::default();
        config.global.prefix = FileName::new(self.prefix.as_bytes()).map_err(|_| refuse())?;
        let folder = self.folder.to_str().ok_or_else(refuse)?;
        let folder = IceoryxPath::new(folder.as_bytes()).map_err(|_| refuse())?;
        config.global.set_root_path(&folder);
        config.global.node.cleanup_dead_nodes_on_creation = false;
        config.global.node.cleanup_dead_nodes_on_destruction = false;
        config.global.service.cleanup_dead_nodes_on_open = false;
        Ok(config)
    }

    /// Admits a controller of this pair.
    pub(super) fn set_ready(&self, pair: Option<Pair>) -> io::Result<()> {
        fs::write(self.folder.join(ready_for(pair)), "")
    }

    /// Joins the run; returns `false` if another controller has joined it before.
    pub(super) fn join(&self) -> io::Result<bool> {
        let joined = OpenOptions::new()
            .write(true)
            .create_new(true)
            .open(self.folder.join(JOINED));
        match joined {
            Ok(_) => Ok(true),
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => Ok(false),
            Err(error) => Err(error),
        }
    }

    /// Signals the plant that the controller is ready for frames, and which one it is.
    pub(super) fn set_answering(&self, name: &str) -> io::Result<()> {
        // The file appears with its contents.
        let unnamed = self.folder.join("answering.new");
        fs::write(&unnamed, name)?;
        fs::rename(unnamed, self.folder.join(ANSWERING))
    }

    /// Returns the controller's name; `None` if it has not given any.
    pub(super) fn controller_name(&self) -> Option<String> {
        const LONGEST: usize = 64;
        let text = fs::read_to_string(self.folder.join(ANSWERING)).ok()?;
        let is_printable = |letter: &char| !letter.is_control();
        let name: String = text
            .trim()
            .chars()
            .filter(is_printable)
            .take(LONGEST)
            .collect();
        Some(name).filter(|name| !name.is_empty())
    }

    /// Returns whether a controller has been ready for frames.
    pub(super) fn is_answering(&self) -> bool {
        self.has(ANSWERING)
    }

    /// Returns whether a controller has ever joined.
    pub(super) fn is_joined(&self) -> bool {
        self.has(JOINED)
    }

    fn lock_path(&self) -> PathBuf {
        Path::new(SHARED_MEMORY).join(format!("{}{LOCK}", self.prefix))
    }

    /// Marks the run's shared memory as in use until the returned file is dropped. The plant
    /// makes the file; for the controller it must be there.
    pub(super) fn hold(&self, role: Role) -> io::Result<LockFile> {
        let start = Instant::now();
        loop {
            let file = LockFile::open(&self.lock_path(), role == Role::Plant)?;
            // A repair may have come between the two, and have removed the file.
            if file.try_hold(role)? && file.is_at(&self.lock_path()) {
                return Ok(file);
            }
            if start.elapsed() >= REPAIR_PATIENCE {
                return Err(io::Error::other("another process holds its lock"));
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Gives every segment of the run its memory now. Otherwise a segment gets it when it is
    /// written, and with none left the kernel ends the writer with SIGBUS.
    pub(super) fn reserve(&self) -> io::Result<()> {
        for (path, metadata) in segments(&self.prefix)? {
            let length = i64::try_from(metadata.len()).map_err(io::Error::other)?;
            if length > 0 {
                let segment = OpenOptions::new().read(true).write(true).open(path)?;
                while let Err(error) = posix_fallocate(&segment, 0, length) {
                    if error != Errno::EINTR {
                        return Err(error.into());
                    }
                }
            }
        }
        Ok(())
    }

    /// Asks the system for a little of what iceoryx2 needs in the run's folder and in shared memory.
    pub(super) fn probe(&self) -> Result<(), LinkError> {
        for (folder, bytes) in [
            (self.folder.as_path(), 1 << 12),
            (Path::new(SHARED_MEMORY), 1 << 16),
        ] {
            let ask = || {
                let mut file = tempfile::tempfile_in(folder)?;
                file.write_all(&vec![1; bytes])?;
                let descriptors = (0..8).map(|_| file.try_clone());
                descriptors.collect::<io::Result<Vec<_>>>()
            };
            ask().map_err(|error| LinkError::Folder {
                folder: folder.into(),
                source: error.into(),
            })?;
        }
        Ok(())
    }

    fn has(&self, name: &str) -> bool {
        fs::exists(self.folder.join(name)).unwrap_or(false)
    }

    /// Removes the run's folder and its segments.
    pub(super) fn remove(&self) -> io::Result<()> {
        // The folder goes last, because its name leads to the names of the segments.
        remove_segments(&self.prefix)?;
        tolerate_missing(fs::remove_dir_all(&self.folder))
    }

    /// Removes every run in a bus's folder; no process may be on that bus.
    pub(super) fn remove_all(folder: &Path, place: &Place) -> io::Result<()> {
        all(folder, place)?.iter().try_for_each(Self::remove)
    }

    /// Removes segments that a dead process left half-made (of size zero, or still write-only), so
    /// that a call that tries to open them ends.
    ///
    /// iceoryx2-cal 0.9.3 (and 0.10.0) tries to open a segment of size zero again and again without
    /// checking its timeout: `dynamic_storage/posix_shared_memory.rs`, `open_impl`, match arm
    /// `MappingSizeIsZero`. A process that dies between `shm_open` and `ftruncate` leaves such a
    /// segment. Each attempt opens the segment by name, so removing the name ends the call.
    pub(super) fn remove_half_made(bus_folder: &Path, place: &Place) {
        for run in all(bus_folder, place).unwrap_or_default() {
            for (path, metadata) in segments(&run.prefix).unwrap_or_default() {
                let write_only = metadata.permissions().mode() & 0o777 == 0o200;
                if (metadata.len() == 0 || write_only) && path != run.lock_path() {
                    let _ = fs::remove_file(path);
                }
            }
        }
    }
}

/// Returns the name of the file that admits a controller. Controllers that belong to no pair look for
/// the plain name.
fn ready_for(pair: Option<Pair>) -> String {
    pair.map_or_else(|| READY.into(), |pair| format!("{READY}-{pair}"))
}

fn all(folder: &Path, place: &Place) -> io::Result<Vec<RunFiles>> {
    let mut runs = Vec::new();
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_type()?.is_dir() {
            runs.push(RunFiles::at(entry.path(), place));
        }
    }
    Ok(runs)
}

fn segments(prefix: &str) -> io::Result<Vec<(PathBuf, fs::Metadata)>> {
    let mut segments = Vec::new();
    for entry in fs::read_dir(SHARED_MEMORY)? {
        let entry = entry?;
        if entry.file_name().to_string_lossy().starts_with(prefix) {
            match entry.metadata() {
                Ok(metadata) => segments.push((entry.path(), metadata)),
                // Removed since it was listed.
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                Err(error) => return Err(error),
            }
        }
    }
    Ok(segments)
}

/// Removes the segments with this prefix. The lock file goes last: a repair that finds segments
/// without one leaves them alone.
pub(super) fn remove_segments(prefix: &str) -> io::Result<()> {
    let lock = format!("{prefix}{LOCK}");
    let mut paths: Vec<_> = segments(prefix)?
        .into_iter()
        .map(|(path, _)| path)
        .collect();
    paths.sort_by_key(|path| path.ends_with(&lock));
    paths
        .into_iter()
        .try_for_each(|path| tolerate_missing(fs::remove_file(path)))
}

/// The shared memory of runs of this user, by run: their prefixes.
pub(super) fn prefixes(place: &Place) -> io::Result<BTreeSet<String>> {
    let length = place.prefix.len() + NAME_LENGTH + 1;
    let names = segments(&place.prefix)?
        .into_iter()
        .filter_map(|(path, _)| {
            let name = path.file_name()?.to_str()?.to_owned();
            name.get(..length)
                .filter(|prefix| prefix.ends_with('_'))
                .map(str::to_owned)
        });
    Ok(names.collect())
}

/// The lock file of the run with this prefix, if there is one.
pub(super) fn lock_of(prefix: &str) -> Option<LockFile> {
    let path = Path::new(SHARED_MEMORY).join(format!("{prefix}{LOCK}"));
    LockFile::open(&path, false).ok()
}

fn tolerate_missing(removed: io::Result<()>) -> io::Result<()> {
    match removed {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        other => other,
    }
}

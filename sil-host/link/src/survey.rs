//! A survey of this user's buses, and the removal of dead ones.
//!
//! The survey does not rely on finding processes, because those of other PID namespaces cannot be
//! found. A bus or segment is dead if it has a lock file and no process holds a lock on it.

use std::fs;
use std::io;
use std::path::PathBuf;

use super::claim::{Bus, remove_dead};
use super::lock_file::Role;
use super::place::Place;
use super::run_files::{lock_of, prefixes, remove_segments};
use super::{BusName, LinkError};

/// A bus with a folder.
#[derive(Clone, Debug)]
pub struct BusState {
    /// Its name.
    pub name: BusName,
    /// Whether a plant is on it.
    pub has_plant: bool,
    /// Whether a controller is on it.
    pub has_controller: bool,
}

/// Use of a run's shared memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SegmentState {
    /// A process holds its lock.
    InUse,
    /// There is a lock file, but no process holds a lock on it.
    Dead,
    /// There is no lock file, so the state is unknown.
    Unknown,
}

/// The shared memory of one run.
#[derive(Clone, Debug)]
pub struct Segments {
    /// Prefix of the names of its files in `/dev/shm`.
    pub prefix: String,
    /// Its use.
    pub state: SegmentState,
}

/// This user's buses and shared memory.
#[derive(Clone, Debug)]
pub struct Survey {
    /// The folder of all buses.
    pub folder: PathBuf,
    /// Buses with a folder, by name.
    pub buses: Vec<BusState>,
    /// Shared memory of this user's runs, by name; also of runs whose bus is in another folder.
    pub segments: Vec<Segments>,
}

impl Survey {
    /// Surveys the buses. Creates only the folder of all buses, if it does not exist.
    ///
    /// # Errors
    /// [`LinkError::Folder`] if the folder of the buses or shared memory cannot be read.
    pub fn take() -> Result<Self, LinkError> {
        let place = Place::of_user()?;
        let entries = fs::read_dir(&place.folder).into_iter().flatten().flatten();
        let mut buses: Vec<BusState> = entries
            .filter_map(|entry| entry.file_name().to_str()?.parse().ok())
            .map(|name| state_of(name, &place))
            .collect();
        buses.sort_by(|one, other| one.name.as_str().cmp(other.name.as_str()));
        let segments = prefixes(&place).map_err(|cause| refuse(&place, cause))?;
        let segments = segments.into_iter().map(|prefix| Segments {
            state: match lock_of(&prefix) {
                None => SegmentState::Unknown,
                Some(lock) if lock.is_used() => SegmentState::InUse,
                Some(_) => SegmentState::Dead,
            },
            prefix,
        });
        Ok(Self {
            segments: segments.collect(),
            folder: place.folder,
            buses,
        })
    }

    /// Removes dead buses and shared memory, and keeps everything else.
    ///
    /// # Errors
    /// As [`Survey::take`].
    pub fn repair() -> Result<(), LinkError> {
        let place = Place::of_user()?;
        remove_dead(&place);
        for prefix in prefixes(&place).map_err(|cause| refuse(&place, cause))? {
            // The next survey shows what could not be removed.
            let _ = remove_if_dead(&prefix);
        }
        Ok(())
    }
}

fn state_of(name: BusName, place: &Place) -> BusState {
    let bus = Bus {
        name,
        place: place.clone(),
    };
    let lock = bus.look();
    let has = |role| lock.as_ref().is_some_and(|lock| lock.is_held(role));
    BusState {
        has_plant: has(Role::Plant),
        has_controller: has(Role::Controller),
        name: bus.name,
    }
}

fn remove_if_dead(prefix: &str) -> io::Result<()> {
    let Some(lock) = lock_of(prefix) else {
        return Ok(());
    };
    // Held during the removal, so that no process can begin to use the segments.
    if lock.try_hold(Role::Plant)? && lock.try_hold(Role::Controller)? {
        remove_segments(prefix)?;
    }
    Ok(())
}

fn refuse(place: &Place, cause: io::Error) -> LinkError {
    LinkError::Folder {
        folder: place.folder.clone(),
        source: cause.into(),
    }
}

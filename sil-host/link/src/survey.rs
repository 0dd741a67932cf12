//! What there is of this user's buses, alive or dead, and the removal of what is dead.
//!
//! Nothing is called dead because no process can be found that uses it: processes of other
//! PID namespaces cannot be found. Dead is what has a lock file on which nobody holds a lock.

use std::fs;
use std::io;
use std::path::PathBuf;

use super::claim::{Bus, Role, remove_dead};
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

/// Who uses shared memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SegmentState {
    /// A process holds its lock.
    InUse,
    /// It has a lock file, and nobody holds a lock on it.
    Dead,
    /// It has no lock file: nothing can be said.
    Unknown,
}

/// The shared memory of one run.
#[derive(Clone, Debug)]
pub struct Segments {
    /// What the names of its files in `/dev/shm` begin with.
    pub prefix: String,
    /// Who uses it.
    pub state: SegmentState,
}

/// What there is of this user's buses.
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
    /// Looks at the buses. Only the folder of all buses is made if there is none.
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
        let segments = prefixes(&place).map_err(|cause| refuse(&place, &cause))?;
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

    /// Removes what is dead: buses on which nobody is, and shared memory whose lock nobody
    /// holds. Everything else stays.
    ///
    /// # Errors
    /// As [`Survey::take`].
    pub fn repair() -> Result<(), LinkError> {
        let place = Place::of_user()?;
        remove_dead(&place);
        for prefix in prefixes(&place).map_err(|cause| refuse(&place, &cause))? {
            // What cannot be removed is there in the next survey.
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
    // Held while the segments go, so that nobody can begin to use them.
    if lock.try_hold(Role::Plant)? && lock.try_hold(Role::Controller)? {
        remove_segments(prefix)?;
    }
    Ok(())
}

fn refuse(place: &Place, cause: &io::Error) -> LinkError {
    LinkError::Folder {
        folder: place.folder.clone(),
        reason: cause.to_string(),
    }
}

//! Wakes an end that sleeps until the other one sends, and tells an end whether it may spin instead.
//!
//! Both ends map the lock file of their run (`run_files`), which holds a cache line for each, the
//! plant's first:
//!
//! | offset | type | field                                                                  |
//! |--------|------|------------------------------------------------------------------------|
//! | 0      | u32  | `asleep`: 1 while the end sleeps or is about to; a futex               |
//! | 4      | u32  | `processor`: 1 + the processor on which the end last waited            |
//!
//! An end says that it is about to sleep, looks for a message once more, and then sleeps. The other
//! one sends its message, and then looks whether it must wake its peer. A full barrier lies between
//! the two steps of either end, so at least one of them sees what the other has done. Only an end
//! that wakes a sleeper makes a system call.
//!
//! While the peer needs the processor of this end, spinning only delays it; hence `processor`. An
//! end of another program may leave its line at 0: it is never asleep, and it wakes nobody.

use std::cell::Cell;
use std::io;
use std::sync::atomic::{AtomicU32, Ordering, fence};
use std::time::Duration;

use memmap2::{MmapOptions, MmapRaw};
use nix::sched::sched_getcpu;
use rustix::thread::futex::{self, Flags, Timespec};

use super::lock_file::{LockFile, Role};
use super::services::transport;
use super::{BusName, LinkError};

/// What an end writes for the other one.
#[repr(C, align(64))]
struct Line {
    asleep: AtomicU32,
    processor: AtomicU32,
}

/// One line for each [`Role`].
type Lines = [Line; 2];

/// Longest sleep of an end that its peer does not wake.
const NAP: Duration = Duration::from_micros(20);

/// The bell of one end.
pub(super) struct Bell {
    memory: MmapRaw,
    role: Role,
    /// What this end has last written to `processor`.
    processor: Cell<u32>,
}

impl Bell {
    /// Hangs the bell of one end of `bus` in the lock file of its run.
    ///
    /// # Errors
    /// [`LinkError::Incompatible`] if the plant's program has no bell, [`LinkError::Transport`].
    pub(super) fn hang(bus: &BusName, lock: &LockFile, role: Role) -> Result<Self, LinkError> {
        let length = size_of::<Lines>();
        let refuse = |cause: io::Error| transport(bus, "map its shared memory", cause);
        match role {
            Role::Plant => lock.file().set_len(length as u64).map_err(refuse)?,
            // An access beyond the end of a file would kill the process.
            Role::Controller => {
                if lock.file().metadata().map_err(refuse)?.len() < length as u64 {
                    return Err(LinkError::Incompatible { bus: bus.clone() });
                }
            }
        }
        let bell = Self {
            memory: (MmapOptions::new().len(length).map_raw(lock.file())).map_err(refuse)?,
            role,
            processor: Cell::new(0),
        };
        bell.peer_runs_elsewhere();
        Ok(bell)
    }

    #[allow(unsafe_code)]
    #[inline]
    fn line(&self, role: Role) -> &Line {
        // SAFETY: the mapping is as long as `Lines` and lives as long as `self`; it begins on a page,
        // and every bit pattern is a valid `Line`, all of whose fields are atomic.
        let lines = unsafe { &*self.memory.as_ptr().cast::<Lines>() };
        match role {
            Role::Plant => &lines[0],
            Role::Controller => &lines[1],
        }
    }

    /// Wakes the peer if it sleeps. Call it after each message.
    #[inline]
    pub(super) fn ring(&self) {
        fence(Ordering::SeqCst);
        let asleep = &self.line(self.role.peer()).asleep;
        if asleep.load(Ordering::Relaxed) != 0 {
            wake(asleep);
        }
    }

    /// Returns whether the peer last waited on another processor than this end does now.
    #[inline]
    pub(super) fn peer_runs_elsewhere(&self) -> bool {
        // Without the number, every processor is another one.
        let here = sched_getcpu().map_or(0, |number| number as u32 + 1);
        if self.processor.replace(here) != here {
            self.line(self.role)
                .processor
                .store(here, Ordering::Relaxed);
        }
        let peers = self
            .line(self.role.peer())
            .processor
            .load(Ordering::Relaxed);
        peers != here || here == 0
    }

    /// Says that this end is about to sleep. Look for a message once more before you let it.
    pub(super) fn arm(&self) {
        self.line(self.role).asleep.store(1, Ordering::Relaxed);
        fence(Ordering::SeqCst);
    }

    /// Sleeps until the peer rings, at most `longest`, or for a moment if the peer never rings.
    /// Returns at once if the peer has rung since [`Bell::arm`].
    pub(super) fn sleep(&self, longest: Duration) {
        let peer = self.line(self.role.peer());
        let rings = peer.processor.load(Ordering::Relaxed) != 0;
        let limit = if rings { longest } else { longest.min(NAP) };
        let limit = Timespec {
            tv_sec: limit.as_secs() as i64,
            tv_nsec: limit.subsec_nanos().into(),
        };
        // Whatever ends the sleep, the caller looks for a message.
        let asleep = &self.line(self.role).asleep;
        let _ = futex::wait(asleep, Flags::empty(), 1, Some(&limit));
    }
}

#[cold]
fn wake(asleep: &AtomicU32) {
    asleep.store(0, Ordering::Relaxed);
    let _ = futex::wake(asleep, Flags::empty(), 1);
}

#[cfg(test)]
mod tests {
    use std::thread;
    use std::time::Instant;

    use super::*;

    /// Far longer than a test waits for anything but a lost wake-up.
    const LONG: Duration = Duration::from_secs(60);

    /// The bells of both ends.
    fn bells() -> (Bell, Bell) {
        let file = tempfile::NamedTempFile::new().unwrap();
        let lock = LockFile::open(file.path(), false).unwrap();
        let hang = |role| Bell::hang(&BusName::unique(), &lock, role).unwrap();
        (hang(Role::Plant), hang(Role::Controller))
    }

    #[test]
    fn a_sleeper_is_woken_by_its_peer_alone() {
        let (own, peers) = bells();
        let start = Instant::now();
        own.arm();
        own.sleep(Duration::from_millis(20));
        assert!(start.elapsed() >= Duration::from_millis(20));

        own.arm();
        let peer = thread::spawn(move || {
            thread::sleep(Duration::from_millis(20));
            peers.ring();
        });
        own.sleep(LONG);
        assert!(start.elapsed() < LONG);
        peer.join().unwrap();
    }

    #[test]
    fn a_ring_before_the_sleep_is_not_lost() {
        let (own, peers) = bells();
        let start = Instant::now();
        own.arm();
        peers.ring();
        own.sleep(LONG);
        assert!(start.elapsed() < LONG);
    }

    #[test]
    fn a_peer_that_has_no_bell_is_polled() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let lock = LockFile::open(file.path(), false).unwrap();
        let own = Bell::hang(&BusName::unique(), &lock, Role::Plant).unwrap();
        let start = Instant::now();
        own.arm();
        own.sleep(LONG);
        assert!(start.elapsed() < LONG);
    }

    #[test]
    fn a_plant_without_a_bell_is_of_another_version() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let lock = LockFile::open(file.path(), false).unwrap();
        let error = Bell::hang(&BusName::unique(), &lock, Role::Controller).err();
        assert!(matches!(error, Some(LinkError::Incompatible { .. })));
    }
}

//! A thread that sees to it that no call into iceoryx2 lasts for ever.
//!
//! Every such call is bracketed by [`Guardian::during`]. When one lasts long and the peer is
//! dead, what the peer has left half-made is removed, which ends the call (see
//! [`RunFiles::remove_half_made`]). When the peer lives but is stopped in the middle of
//! making something, or anything else holds the call up, the process says so and ends: a call
//! into iceoryx2 cannot be broken off.

use std::io::{self, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use super::LinkError;
use super::claim::{Bus, Claim, LockFile, Role};
use super::run_files::RunFiles;

/// Exit code of a process that is held up, as of any whose peer has failed.
const PEER_FAILED: i32 = 3;
/// Time between two looks. Looks are counted, not the clock: when this very process is
/// stopped, both of its threads are.
const LOOK: Duration = Duration::from_millis(25);
/// Looks until what a dead peer has left is removed: so many that nothing this process is
/// making itself, however busy the machine, is still half-made then.
const LOOKS_UNTIL_REMOVAL: u32 = 40;
/// Looks until the process ends.
const LOOKS_UNTIL_END: u32 = 60;

/// Watches the calls of one end.
#[derive(Debug)]
pub(super) struct Guardian {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Debug, Default)]
struct Shared {
    /// Odd during a call; another number for every call.
    calls: AtomicU32,
    over: AtomicBool,
}

impl Guardian {
    /// Starts to watch.
    pub(super) fn start(claim: &Claim) -> io::Result<Self> {
        let shared = Arc::new(Shared::default());
        let watch = Watch {
            shared: Arc::clone(&shared),
            bus: claim.bus().clone(),
            lock: claim.share()?,
            peer: claim.role().peer(),
        };
        let thread = std::thread::Builder::new()
            .name("link-guardian".into())
            .spawn(move || watch.run())?;
        Ok(Self {
            shared,
            thread: Some(thread),
        })
    }

    /// Makes a call into iceoryx2 that must end soon.
    #[inline]
    pub(super) fn during<T>(&self, call: impl FnOnce() -> T) -> T {
        self.shared.calls.fetch_add(1, Ordering::Relaxed);
        let outcome = call();
        self.shared.calls.fetch_add(1, Ordering::Relaxed);
        outcome
    }

    /// First and last field of a struct that is watched while its other fields drop.
    pub(super) fn marks(&self) -> (Mark, Mark) {
        let mark = || Mark(Arc::clone(&self.shared));
        (mark(), mark())
    }
}

/// Begins a call, or ends it, when it drops.
#[derive(Debug)]
pub(super) struct Mark(Arc<Shared>);

impl Drop for Mark {
    fn drop(&mut self) {
        self.0.calls.fetch_add(1, Ordering::Relaxed);
    }
}

impl Drop for Guardian {
    fn drop(&mut self) {
        self.shared.over.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            thread.thread().unpark();
            let _ = thread.join();
        }
    }
}

struct Watch {
    shared: Arc<Shared>,
    bus: Bus,
    lock: LockFile,
    peer: Role,
}

impl Watch {
    fn run(&self) {
        let mut last = 0;
        let mut looks = 0;
        while !self.shared.over.load(Ordering::Relaxed) {
            std::thread::park_timeout(LOOK);
            let call = self.shared.calls.load(Ordering::Relaxed);
            let same = call == last && call % 2 == 1;
            looks = if same { looks + 1 } else { 0 };
            last = call;
            if looks >= LOOKS_UNTIL_REMOVAL && !self.lock.is_held(self.peer) {
                RunFiles::remove_half_made(&self.bus);
            }
            if looks >= LOOKS_UNTIL_END {
                self.give_up();
            }
        }
    }

    /// Ends the process: the thread that called cannot be called back.
    fn give_up(&self) -> ! {
        let (bus, silence) = (self.bus.name.clone(), LOOK * LOOKS_UNTIL_END);
        let error = match self.peer {
            Role::Plant => LinkError::PlantSilent { bus, silence },
            Role::Controller => LinkError::ControllerSilent { bus, silence },
        };
        let _ = writeln!(io::stderr(), "error: {error}");
        std::process::exit(PEER_FAILED)
    }
}

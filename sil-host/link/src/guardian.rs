//! A thread that bounds the time of every call into iceoryx2.
//!
//! Every such call goes through [`Guardian::during`]. If a call takes long and the peer is dead,
//! the guardian removes the peer's incomplete files, which ends the call (see
//! [`RunFiles::remove_half_made`]). If the peer is alive but was stopped while it created
//! something, or if the call blocks for another reason, the process reports this and exits, because
//! a call into iceoryx2 cannot be cancelled.

use std::io::{self, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use super::LinkError;
use super::claim::{Bus, Claim};
use super::lock_file::{LockFile, Role};
use super::run_files::RunFiles;

/// Exit code of a process whose call is blocked; the same as for any failed peer.
const PEER_FAILED: i32 = 3;
/// Interval between two checks. The limits count checks rather than time, because stopping this
/// process stops both of its threads.
const LOOK: Duration = Duration::from_millis(25);
/// Checks before the guardian removes a dead peer's incomplete files. By then nothing that this
/// process itself creates is still half-made, even on a busy machine.
const LOOKS_UNTIL_REMOVAL: u32 = 40;
/// Checks before the process exits.
const LOOKS_UNTIL_END: u32 = 60;

/// Watches the calls of one end of the link.
#[derive(Debug)]
pub(super) struct Guardian {
    shared: Arc<CallCount>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Debug, Default)]
struct CallCount {
    /// Odd during a call; every call changes it.
    calls: AtomicU32,
    over: AtomicBool,
}

impl Guardian {
    /// Starts the watching thread.
    pub(super) fn start(claim: &Claim) -> io::Result<Self> {
        let shared = Arc::new(CallCount::default());
        let watch = PeerWatch {
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

    /// Runs a call into iceoryx2 under the guardian's time limit.
    #[inline]
    pub(super) fn during<T>(&self, call: impl FnOnce() -> T) -> T {
        self.shared.calls.fetch_add(1, Ordering::Relaxed);
        let outcome = call();
        self.shared.calls.fetch_add(1, Ordering::Relaxed);
        outcome
    }

    /// Returns the first and last field of a struct whose remaining fields are watched while they
    /// drop.
    pub(super) fn marks(&self) -> (CallMark, CallMark) {
        let mark = || CallMark(Arc::clone(&self.shared));
        (mark(), mark())
    }
}

/// Begins or ends a watched call when it drops.
#[derive(Debug)]
pub(super) struct CallMark(Arc<CallCount>);

impl Drop for CallMark {
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

struct PeerWatch {
    shared: Arc<CallCount>,
    bus: Bus,
    lock: LockFile,
    peer: Role,
}

impl PeerWatch {
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
                RunFiles::remove_half_made(&self.bus.folder(), &self.bus.place);
            }
            if looks >= LOOKS_UNTIL_END {
                self.give_up();
            }
        }
    }

    /// Exits the process, because the blocked thread cannot be interrupted.
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

//! How an end waits for its peer: it spins for a moment, then sleeps until the peer wakes it.
//!
//! On two idle processors the answer of a lockstep peer arrives during the spin, after about a
//! microsecond. The spin is longer than a sleeper takes to wake up, so that one late answer does not
//! put both ends to sleep for all further ones. Where both ends share a processor, a spin would keep
//! the peer from running: there the wait sleeps at once.

use std::time::{Duration, Instant};

use super::bell::Bell;

/// Default limit of a peer's silence; a longer silence is an error.
pub const DEFAULT_SILENCE_LIMIT: Duration = Duration::from_millis(1500);

/// Polls of a spin; they take some 50 µs.
const SPIN_POLLS: u32 = 1000;
/// Interval between two checks whether the peer's process is alive. A check takes some tens of
/// microseconds and allocates. No sleep is longer.
pub(super) const LOOK_INTERVAL: Duration = Duration::from_millis(50);
/// Longest time that one pause adds to the silence. A longer pause means that this process was
/// stopped (Ctrl-Z, a debugger), most likely together with its peer, so the peer gets more time.
const LONGEST_PAUSE: Duration = Duration::from_millis(100);

/// Next step after a pause.
pub(super) enum AfterPause {
    /// Poll again.
    Poll,
    /// Check whether the peer is alive, then poll again.
    Look,
    /// Give up: the peer has been silent for this long.
    GiveUp(Duration),
}

/// Duration of a peer's silence.
#[derive(Default)]
pub(super) struct Silence {
    last: Option<Instant>,
    total: Duration,
    looked: Duration,
}

impl Silence {
    /// Adds the time since the last call; the first call adds none.
    pub(super) fn grow(&mut self, limit: Duration) -> AfterPause {
        let now = Instant::now();
        let pause = now - self.last.replace(now).unwrap_or(now);
        self.total += pause.min(LONGEST_PAUSE);

        if self.total >= limit {
            AfterPause::GiveUp(self.total)
        } else if self.total - self.looked >= LOOK_INTERVAL {
            self.looked = self.total;
            AfterPause::Look
        } else {
            AfterPause::Poll
        }
    }
}

/// The pauses between the polls of one wait.
#[derive(Default)]
pub(super) struct Pauses {
    polls: u32,
    is_armed: bool,
}

impl Pauses {
    /// Call it before the first poll: where both ends share a processor, that poll is then the last one before the
    /// sleep. Without it, the wait spins first.
    #[inline]
    pub(super) fn begin(&mut self, bell: &Bell) {
        if self.polls == 0 && !bell.peer_runs_elsewhere() {
            self.polls = SPIN_POLLS;
            self.is_armed = true;
            bell.arm();
        }
    }

    /// Pauses for a few nanoseconds while this end spins; returns `false` once it should sleep.
    #[inline]
    fn spin(&mut self) -> bool {
        let spins = self.polls < SPIN_POLLS;
        if spins {
            self.polls += 1;
            std::hint::spin_loop();
        }
        spins
    }

    /// Sleeps at most `longest`, but only after one more poll, which finds a message that has
    /// arrived before the bell was armed.
    fn sleep(&mut self, bell: &Bell, longest: Duration) {
        if self.is_armed {
            bell.sleep(longest.min(LOOK_INTERVAL));
        } else {
            bell.arm();
        }
        self.is_armed = !self.is_armed;
    }

    /// Pauses once, at most `longest`.
    pub(super) fn pause(&mut self, bell: &Bell, longest: Duration) {
        if !self.spin() {
            self.sleep(bell, longest);
        }
    }
}

/// One wait, from the first unsuccessful poll to the answer.
pub(super) struct Patience {
    limit: Duration,
    pauses: Pauses,
    /// Counted only from the second pause after spinning on; until then the clock is not read, since the answer of a
    /// lockstep peer ends the first one.
    silence: Option<Silence>,
}

impl Patience {
    /// Starts a wait that gives up after `limit`.
    #[inline]
    pub(super) fn new(limit: Duration) -> Self {
        Self {
            limit,
            pauses: Pauses::default(),
            silence: None,
        }
    }

    /// Call it before the first poll of the wait.
    #[inline]
    pub(super) fn begin(&mut self, bell: &Bell) {
        self.pauses.begin(bell);
    }

    /// Pauses once, at most `longest`, and returns the next step.
    #[inline]
    pub(super) fn pause(&mut self, bell: &Bell, longest: Duration) -> AfterPause {
        if self.pauses.spin() {
            AfterPause::Poll
        } else {
            self.rest(bell, longest)
        }
    }

    /// Sleeps instead of spinning, at most `longest`, and returns the next step.
    #[cold]
    pub(super) fn rest(&mut self, bell: &Bell, longest: Duration) -> AfterPause {
        let next = self.count();
        if let AfterPause::Poll = next {
            let left = match &self.silence {
                Some(silence) => self.limit.saturating_sub(silence.total),
                None => self.limit,
            };
            self.pauses.sleep(bell, longest.min(left));
        }
        next
    }

    /// Counts the silence without a pause, and returns the next step.
    pub(super) fn count(&mut self) -> AfterPause {
        match &mut self.silence {
            Some(silence) => silence.grow(self.limit),
            none => {
                *none = Some(Silence::default());
                AfterPause::Poll
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::BusName;
    use crate::lock_file::{LockFile, Role};

    /// A bell whose peer has never waited.
    fn lonely_bell() -> Bell {
        let file = tempfile::NamedTempFile::new().unwrap();
        let lock = LockFile::open(file.path(), false).unwrap();
        Bell::hang(&BusName::unique(), &lock, Role::Plant).unwrap()
    }

    #[test]
    fn a_wait_checks_the_peer_and_then_gives_up() {
        let limit = Duration::from_millis(120);
        let bell = lonely_bell();
        let mut patience = Patience::new(limit);
        let mut looks = 0;
        let silence = loop {
            match patience.pause(&bell, limit) {
                AfterPause::Poll => {}
                AfterPause::Look => looks += 1,
                AfterPause::GiveUp(silence) => break silence,
            }
        };
        assert!(silence >= limit);
        assert!(looks >= 1);
    }

    /// Both bells of a run whose ends share the processor of this thread, which stays on it.
    fn bells_on_one_processor() -> (Bell, Bell) {
        use nix::sched::{CpuSet, sched_getcpu, sched_setaffinity};
        let mut here = CpuSet::new();
        here.set(sched_getcpu().unwrap()).unwrap();
        sched_setaffinity(nix::unistd::Pid::from_raw(0), &here).unwrap();
        let file = tempfile::NamedTempFile::new().unwrap();
        let lock = LockFile::open(file.path(), false).unwrap();
        let hang = |role| Bell::hang(&BusName::unique(), &lock, role).unwrap();
        let (own, peers) = (hang(Role::Plant), hang(Role::Controller));
        assert!(!own.peer_runs_elsewhere());
        (own, peers)
    }

    #[test]
    fn no_wait_sleeps_without_a_poll_after_it_has_armed_its_bell() {
        let (own, peers) = bells_on_one_processor();
        let far = Duration::from_secs(60);
        // Armed before the poll: a message that comes after it ends the sleep.
        let start = Instant::now();
        let mut pauses = Pauses::default();
        pauses.begin(&own);
        peers.ring();
        pauses.pause(&own, far);
        assert!(start.elapsed() < LOOK_INTERVAL);
        // Not armed: the bell that rings after the poll is not heard, so that the next pause must not sleep.
        let mut pauses = Pauses::default();
        peers.ring();
        pauses.pause(&own, far);
        assert_eq!((pauses.polls, pauses.is_armed), (1, false));
        // Nor does the first rest of a wait that does not spin.
        let mut patience = Patience::new(far);
        peers.ring();
        patience.rest(&own, far);
        assert!(start.elapsed() < LOOK_INTERVAL);
        assert!(patience.pauses.is_armed);
    }

    #[test]
    fn stopping_this_process_does_not_count_as_silence_of_the_peer() {
        let mut silence = Silence::default();
        assert!(matches!(
            silence.grow(DEFAULT_SILENCE_LIMIT),
            AfterPause::Poll
        ));
        silence.last = Instant::now().checked_sub(Duration::from_secs(1));
        silence.grow(DEFAULT_SILENCE_LIMIT);
        assert_eq!(silence.total, LONGEST_PAUSE);
    }
}

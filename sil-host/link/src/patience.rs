//! How an end waits for its peer: spin briefly, then yield, then nap.
//!
//! On two idle cores the answer of a lockstep peer arrives while spinning, about
//! a microsecond. With other work on the machine a pure spin would wait whole
//! scheduler slices for a peer that cannot run, so it soon gives the core away,
//! and naps when the wait is long (a real-time tick, an emulator, a debugger).

use std::time::{Duration, Instant};

/// A peer silent for longer than this is an error, unless set otherwise.
pub const DEFAULT_SILENCE_LIMIT: Duration = Duration::from_millis(1500);

/// Polls without a pause; some tens of microseconds.
const SPIN_POLLS: u32 = 1000;
/// Time spent yielding before the first nap.
const YIELD_TIME: Duration = Duration::from_micros(200);
/// A nap; the kernel adds its timer slack, 50 µs unless real-time.
const NAP: Duration = Duration::from_micros(20);
/// Time between two looks at whether the peer's process is alive: a look takes
/// some tens of microseconds and allocates.
const LOOK_INTERVAL: Duration = Duration::from_millis(50);
/// The most one pause counts. A longer one means that this process was stopped
/// (Ctrl-Z, a debugger), most likely with its peer, who deserves a new chance.
const LONGEST_PAUSE: Duration = Duration::from_millis(100);

/// What to do after a pause.
pub(super) enum Next {
    /// Poll again.
    Poll,
    /// See whether the peer is alive, then poll again.
    Look,
    /// Give up: silent for this long.
    GiveUp(Duration),
}

/// How long a peer has been silent.
#[derive(Default)]
pub(super) struct Silence {
    last: Option<Instant>,
    total: Duration,
    looked: Duration,
}

impl Silence {
    /// Counts the time since the last call, none at the first.
    pub(super) fn grow(&mut self, limit: Duration) -> Next {
        let now = Instant::now();
        let pause = now - self.last.replace(now).unwrap_or(now);
        self.total += pause.min(LONGEST_PAUSE);

        if self.total >= limit {
            Next::GiveUp(self.total)
        } else if self.total - self.looked >= LOOK_INTERVAL {
            self.looked = self.total;
            Next::Look
        } else {
            Next::Poll
        }
    }
}

/// One wait, from the first fruitless poll to the answer.
pub(super) struct Patience {
    limit: Duration,
    polls: u32,
    /// Counted once spinning is over: the clock is not read before.
    silence: Silence,
}

impl Patience {
    /// A wait that gives up after `limit`.
    #[inline]
    pub(super) fn new(limit: Duration) -> Self {
        Self {
            limit,
            polls: 0,
            silence: Silence::default(),
        }
    }

    /// Pauses once and says what to do next.
    #[inline]
    pub(super) fn pause(&mut self) -> Next {
        if self.polls < SPIN_POLLS {
            self.polls += 1;
            std::hint::spin_loop();
            Next::Poll
        } else {
            self.pause_longer()
        }
    }

    #[cold]
    fn pause_longer(&mut self) -> Next {
        let next = self.silence.grow(self.limit);
        if let Next::Poll = next {
            if self.silence.total < YIELD_TIME {
                std::thread::yield_now();
            } else {
                std::thread::sleep(NAP);
            }
        }
        next
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wait_looks_after_the_peer_and_then_gives_up() {
        let limit = Duration::from_millis(120);
        let mut patience = Patience::new(limit);
        let mut looks = 0;
        let silence = loop {
            match patience.pause() {
                Next::Poll => {}
                Next::Look => looks += 1,
                Next::GiveUp(silence) => break silence,
            }
        };
        assert!(silence >= limit);
        assert!(looks >= 1);
    }

    #[test]
    fn a_stop_of_this_process_is_not_the_silence_of_the_peer() {
        let mut silence = Silence::default();
        assert!(matches!(silence.grow(DEFAULT_SILENCE_LIMIT), Next::Poll));
        silence.last = Instant::now().checked_sub(Duration::from_secs(1));
        silence.grow(DEFAULT_SILENCE_LIMIT);
        assert_eq!(silence.total, LONGEST_PAUSE);
    }
}

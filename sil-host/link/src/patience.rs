//! How an end waits for its peer: it spins briefly, then yields, then naps.
//!
//! On two idle cores the answer of a lockstep peer arrives during the spin, after about a
//! microsecond. On a busy machine, and where the scheduler lets both ends share a core, a spin
//! keeps the peer from running. The wait therefore soon yields the core, and naps if it lasts long
//! (a real-time tick, an emulator, a debugger).

use std::time::{Duration, Instant};

/// Default limit of a peer's silence; a longer silence is an error.
pub const DEFAULT_SILENCE_LIMIT: Duration = Duration::from_millis(1500);

/// Polls without a pause; they take some microseconds.
const SPIN_POLLS: u32 = 200;
/// Time spent yielding before the first nap.
const YIELD_TIME: Duration = Duration::from_micros(200);
/// Length of a nap; the kernel adds its timer slack, 50 µs unless the process is real-time.
const NAP: Duration = Duration::from_micros(20);
/// Interval between two checks whether the peer's process is alive. A check takes some tens of
/// microseconds and allocates.
const LOOK_INTERVAL: Duration = Duration::from_millis(50);
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

/// One wait, from the first unsuccessful poll to the answer.
pub(super) struct Patience {
    limit: Duration,
    polls: u32,
    /// Counted only after spinning; until then the clock is not read.
    silence: Silence,
}

impl Patience {
    /// Starts a wait that gives up after `limit`.
    #[inline]
    pub(super) fn new(limit: Duration) -> Self {
        Self {
            limit,
            polls: 0,
            silence: Silence::default(),
        }
    }

    /// Pauses once and returns the next step.
    #[inline]
    pub(super) fn pause(&mut self) -> AfterPause {
        if self.polls < SPIN_POLLS {
            self.polls += 1;
            std::hint::spin_loop();
            AfterPause::Poll
        } else {
            self.pause_longer()
        }
    }

    #[cold]
    fn pause_longer(&mut self) -> AfterPause {
        let next = self.silence.grow(self.limit);
        if let AfterPause::Poll = next {
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
    fn a_wait_checks_the_peer_and_then_gives_up() {
        let limit = Duration::from_millis(120);
        let mut patience = Patience::new(limit);
        let mut looks = 0;
        let silence = loop {
            match patience.pause() {
                AfterPause::Poll => {}
                AfterPause::Look => looks += 1,
                AfterPause::GiveUp(silence) => break silence,
            }
        };
        assert!(silence >= limit);
        assert!(looks >= 1);
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

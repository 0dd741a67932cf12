//! The switch of the system clock, which follows its order later.

use crate::{MICROSECOND, Picoseconds};

/// Time until the system clock is another one. The manuals give none, but flags that tell.
const SWITCH: Picoseconds = 2 * MICROSECOND;

/// The source of the system clock, by its number, and when another one takes its place.
#[derive(Clone, Debug)]
pub struct SystemClock {
    source: u32,
    switches_at: Picoseconds,
}

impl SystemClock {
    /// Creates a clock from this source, with no other one ordered.
    pub fn new(source: u32) -> Self {
        Self {
            source,
            switches_at: Picoseconds::MAX,
        }
    }

    /// Returns the number of the present source.
    pub fn source(&self) -> u32 {
        self.source
    }

    /// Orders another source.
    pub fn switch(&mut self, now: Picoseconds) {
        self.switches_at = now + SWITCH;
    }

    /// Returns the time of the next switch.
    pub fn next_event(&self) -> Picoseconds {
        self.switches_at
    }

    /// Takes the source that is `ordered` if it is time; returns whether it was.
    pub fn advance(&mut self, ordered: u32, now: Picoseconds) -> bool {
        let is_due = now >= self.switches_at;
        if is_due {
            *self = Self::new(ordered);
        }
        is_due
    }
}

//! Counts lapses around a tick, each kind separately, and reports when there are too many.
//!
//! A single late tick, broken message or impossible reading is counted and tolerated. More in a row
//! than the limit is a fault, which the controller latches until a reset.

pub use painleve_shared::lapse::{Lapse, LapseCounts, LapseLimits};

/// Lapses of one kind.
#[derive(Clone, Copy, Debug, Default)]
struct Count {
    total: u32,
    in_a_row: u32,
}

/// Counts lapses and reports when there are too many in a row.
#[derive(Clone, Copy, Debug, Default)]
pub struct LapseMonitor {
    limits: LapseLimits,
    counts: [Count; Lapse::COUNT],
}

impl LapseMonitor {
    /// Makes a monitor with all counts at zero.
    pub fn new(limits: LapseLimits) -> Self {
        Self {
            limits,
            ..Self::default()
        }
    }

    /// Records that `lapse` did not occur this time.
    #[inline]
    pub fn note_good(&mut self, lapse: Lapse) {
        self.counts[lapse as usize].in_a_row = 0;
    }

    /// Records how many times `lapse` occurred, 0 for none; returns whether it has now occurred too
    /// often in a row.
    #[inline]
    #[must_use]
    pub fn note(&mut self, lapse: Lapse, times: u32) -> bool {
        let count = &mut self.counts[lapse as usize];
        count.total = count.total.wrapping_add(times);
        let in_a_row = count.in_a_row.saturating_add(times);
        count.in_a_row = if times == 0 { 0 } else { in_a_row };
        count.in_a_row > self.limits.of(lapse)
    }

    /// Returns how often `lapse` has occurred; wraps.
    pub fn total(&self, lapse: Lapse) -> u32 {
        self.counts[lapse as usize].total
    }

    /// Returns how often each lapse has occurred.
    pub fn totals(&self) -> LapseCounts {
        LapseCounts::from_fn(|lapse| self.total(lapse))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_kind_has_its_own_counter_and_limit_and_a_good_tick_restarts_it() {
        for lapse in Lapse::ALL.iter().copied() {
            let limits = LapseLimits::default();
            let limit = limits.of(lapse);
            let mut monitor = LapseMonitor::new(limits);
            for _ in 0..limit {
                assert!(!monitor.note(lapse, 1), "{lapse:?}");
            }
            monitor.note_good(lapse);
            assert!(!monitor.note(lapse, limit));
            for other in Lapse::ALL.iter().copied().filter(|other| *other != lapse) {
                assert!(!monitor.note(other, 1));
                assert_eq!(monitor.total(other), 1);
            }
            assert!(monitor.note(lapse, 1), "{lapse:?}");
            assert_eq!(monitor.total(lapse), 2 * limit + 1);
        }
    }

    #[test]
    fn totals_wrap_without_a_fault() {
        let mut monitor = LapseMonitor::default();
        monitor.counts[Lapse::MissingFrame as usize].total = u32::MAX;
        assert!(!monitor.note(Lapse::MissingFrame, 1));
        assert_eq!(monitor.total(Lapse::MissingFrame), 0);
    }
}

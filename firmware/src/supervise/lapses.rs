//! Counts lapses around a tick, each kind separately, and reports when there are too many.
//!
//! A single late tick, broken message or impossible reading is counted and tolerated. More in a row
//! than the limit is a fault, which the controller latches until a reset. So is a lapse that keeps coming back, for
//! example at every other tick: it takes several good ticks to make up for one lapse.

use painleve_shared::frame::DigitalInputs;
pub use painleve_shared::lapse::{Lapse, LapseCounts, LapseLimits};

/// Lapses that a board detects by itself, and reports by these inputs.
pub const BOARD_LAPSES: [(DigitalInputs, Lapse); 4] = [
    (DigitalInputs::ARMING_REFUSED, Lapse::ArmingRefused),
    (DigitalInputs::STAGE_NOT_READY, Lapse::StageNotReady),
    (DigitalInputs::GAP_AGAINST_FORCE, Lapse::GapAgainstForce),
    (DigitalInputs::WINDING_HOT, Lapse::WindingHot),
];

/// Good ticks that make up for one lapse. With two, a kind that fails at more than a third of the ticks is a fault in
/// the end, whatever its limit, and one of lost frames at more than a quarter, because no tick answers them; with one, a kind that fails at every other tick never would be.
const GOOD_PER_LAPSE: i32 = 2;

/// Lapses of one kind.
#[derive(Clone, Copy, Debug, Default)]
struct Count {
    total: u32,
    /// Good ticks that are needed to make up for the lapses so far. Signed, which takes fewer instructions to keep at zero.
    owed: i32,
}

/// Counts lapses and reports when there are too many.
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

    /// Records how many times `lapse` occurred, 0 for none; returns whether it has now occurred too often.
    #[inline]
    #[must_use]
    pub fn note(&mut self, lapse: Lapse, times: u32) -> bool {
        let count = &mut self.counts[lapse as usize];
        if times == 0 {
            count.owed = (count.owed - 1).max(0);
            return false;
        }
        count.total = count.total.wrapping_add(times);
        let limit = self.limits.of(lapse);
        // One lapse too many: an outage is made up for in the same time, however long it was.
        let [tolerated, most] = [limit, limit + 1].map(|it| GOOD_PER_LAPSE * it as i32);
        let added = GOOD_PER_LAPSE * times.min(limit + 1) as i32;
        count.owed = (count.owed + added).min(most);
        count.owed > tolerated
    }

    /// Returns how often each lapse has occurred; wraps.
    pub fn totals(&self) -> LapseCounts {
        LapseCounts::from_fn(|lapse| self.counts[lapse as usize].total)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_kind_has_its_own_counter_and_limit_and_good_ticks_make_up_for_it() {
        for lapse in Lapse::ALL.iter().copied() {
            let limits = LapseLimits::default();
            let limit = limits.of(lapse);
            let mut monitor = LapseMonitor::new(limits);
            for _ in 0..limit {
                assert!(!monitor.note(lapse, 1), "{lapse:?}");
            }
            for _ in 0..2 * limit {
                assert!(!monitor.note(lapse, 0));
            }
            assert!(!monitor.note(lapse, limit));
            for other in Lapse::ALL.iter().copied().filter(|other| *other != lapse) {
                assert!(!monitor.note(other, 1));
                assert_eq!(monitor.totals().of(other), 1);
            }
            assert!(monitor.note(lapse, 1), "{lapse:?}");
            assert_eq!(monitor.totals().of(lapse), 2 * limit + 1);
        }
    }

    /// Notes lapses at the first of every `period` ticks; returns the tick at which they are too many.
    fn too_many_at(lapse: Lapse, period: u32) -> Option<u32> {
        let mut monitor = LapseMonitor::new(LapseLimits::default());
        (0..10_000).find(|tick| monitor.note(lapse, u32::from(tick % period == 0)))
    }

    #[test]
    fn a_lapse_at_every_other_tick_is_too_much_and_at_every_third_is_not() {
        for lapse in Lapse::ALL.iter().copied() {
            let limit = LapseLimits::default().of(lapse);
            assert_eq!(too_many_at(lapse, 1), Some(limit), "{lapse:?}");
            let tick = too_many_at(lapse, 2);
            assert!(
                tick.is_some_and(|tick| tick < 5 * limit),
                "{lapse:?} {tick:?}"
            );
            assert_eq!(too_many_at(lapse, 3), None, "{lapse:?}");
        }
    }

    #[test]
    fn the_longest_outage_is_made_up_for_as_one_lapse_too_many() {
        let mut monitor = LapseMonitor::new(LapseLimits::default());
        let lapse = Lapse::MissingFrame;
        let limit = LapseLimits::default().of(lapse);
        assert!(monitor.note(lapse, u32::MAX));
        for _ in 0..2 * (limit + 1) {
            assert!(!monitor.note(lapse, 0));
        }
        assert!(!monitor.note(lapse, limit));
    }

    #[test]
    fn totals_wrap_without_a_fault() {
        let mut monitor = LapseMonitor::default();
        monitor.counts[Lapse::MissingFrame as usize].total = u32::MAX;
        assert!(!monitor.note(Lapse::MissingFrame, 1));
        assert_eq!(monitor.totals().of(Lapse::MissingFrame), 0);
    }
}

//! What may go wrong around a tick, each kind with its own counter and limit.
//!
//! A single late tick or broken message is counted and survived; more than a
//! limit in a row is a fault, which the controller latches until it is reset.
//! Stale, lost and out-of-range frames are the controller's own matter: they arrive.

use painleve_shared::status::Fault;

/// A failure around one tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lapse {
    /// The tick was not done when the next one was due.
    Overrun,
    /// There was no sensor frame for the tick.
    MissingFrame,
    /// A message failed its checksum or could not be understood.
    CorruptMessage,
}

/// How many lapses in a row are survived.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DeadlineLimits {
    /// Of [`Lapse::Overrun`].
    pub overruns: u32,
    /// Of [`Lapse::MissingFrame`].
    pub missing_frames: u32,
    /// Of [`Lapse::CorruptMessage`].
    pub corrupt_messages: u32,
}

impl Default for DeadlineLimits {
    /// A tick that overruns once may have met a rare branch; twice is a
    /// processor that is too slow. At 1 kHz the arm moves 10 mm in 20 ms at most.
    fn default() -> Self {
        Self {
            overruns: 1,
            missing_frames: 10,
            corrupt_messages: 10,
        }
    }
}

/// Lapses of one kind.
#[derive(Clone, Copy, Debug, Default)]
struct Count {
    total: u32,
    in_a_row: u32,
}

/// Counts lapses and says when there are too many.
#[derive(Clone, Copy, Debug, Default)]
pub struct DeadlineMonitor {
    limits: DeadlineLimits,
    overruns: Count,
    missing_frames: Count,
    corrupt_messages: Count,
}

impl DeadlineMonitor {
    /// A monitor that has seen nothing.
    pub fn new(limits: DeadlineLimits) -> Self {
        Self {
            limits,
            ..Self::default()
        }
    }

    /// Takes note of whether `lapse` happened this time; returns the fault when it has
    /// happened too often in a row.
    pub fn note(&mut self, lapse: Lapse, happened: bool) -> Option<Fault> {
        let (count, limit, fault) = match lapse {
            Lapse::Overrun => (&mut self.overruns, self.limits.overruns, Fault::Overrun),
            Lapse::MissingFrame => (
                &mut self.missing_frames,
                self.limits.missing_frames,
                Fault::FrameMissing,
            ),
            Lapse::CorruptMessage => (
                &mut self.corrupt_messages,
                self.limits.corrupt_messages,
                Fault::CorruptMessages,
            ),
        };
        if !happened {
            count.in_a_row = 0;
            return None;
        }
        count.total = count.total.wrapping_add(1);
        count.in_a_row = count.in_a_row.saturating_add(1);
        (count.in_a_row > limit).then_some(fault)
    }

    /// How often `lapse` has happened; wraps.
    pub fn total(&self, lapse: Lapse) -> u32 {
        match lapse {
            Lapse::Overrun => self.overruns.total,
            Lapse::MissingFrame => self.missing_frames.total,
            Lapse::CorruptMessage => self.corrupt_messages.total,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_kind_has_its_own_limit_and_a_good_tick_starts_over() {
        let mut monitor = DeadlineMonitor::default();
        assert_eq!(monitor.note(Lapse::Overrun, true), None);
        for _ in 0..10 {
            assert_eq!(monitor.note(Lapse::MissingFrame, true), None);
        }
        assert_eq!(monitor.note(Lapse::MissingFrame, false), None);
        assert_eq!(monitor.note(Lapse::MissingFrame, true), None);
        assert_eq!(monitor.note(Lapse::Overrun, true), Some(Fault::Overrun));
        assert_eq!(monitor.total(Lapse::MissingFrame), 11);
        assert_eq!(monitor.total(Lapse::Overrun), 2);
        assert_eq!(monitor.total(Lapse::CorruptMessage), 0);
    }

    #[test]
    fn totals_wrap_without_a_fault() {
        let mut monitor = DeadlineMonitor::default();
        monitor.missing_frames.total = u32::MAX;
        assert_eq!(monitor.note(Lapse::MissingFrame, true), None);
        assert_eq!(monitor.total(Lapse::MissingFrame), 0);
    }
}

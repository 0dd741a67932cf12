//! What may go wrong with a tick and its sensor frame, each kind with its own counter and limit.
//!
//! A single late tick, broken message or impossible reading is counted and
//! survived; more than a limit in a row is a fault, which the controller latches
//! until it is reset.

use painleve_shared::settings;
use painleve_shared::status::Fault;

/// One kind of failure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(usize)]
pub enum Lapse {
    /// The tick was not done when the next one was due.
    Overrun,
    /// There was no sensor frame when the tick was due: it is late, or lost.
    MissingFrame,
    /// A frame with the sequence number of an earlier one.
    StaleFrame,
    /// A sequence number that never came.
    LostFrame,
    /// An encoder reading that its resolution does not allow.
    EncoderOutOfRange,
    /// A force reading that its resolution does not allow.
    ForceOutOfRange,
    /// Bytes that are no message.
    Garbage,
    /// A message whose checksum is wrong.
    FailedChecksum,
}

impl Lapse {
    /// Number of kinds.
    const COUNT: usize = Self::FailedChecksum as usize + 1;

    /// Those that a frame can be about that has come.
    pub const OF_FRAMES: [Self; 4] = [
        Self::StaleFrame,
        Self::LostFrame,
        Self::EncoderOutOfRange,
        Self::ForceOutOfRange,
    ];

    /// The fault that too many in a row are.
    pub fn fault(self) -> Fault {
        match self {
            Self::Overrun => Fault::Overrun,
            Self::MissingFrame => Fault::FrameMissing,
            Self::StaleFrame => Fault::StaleFrame,
            Self::LostFrame => Fault::FramesLost,
            Self::EncoderOutOfRange => Fault::EncoderOutOfRange,
            Self::ForceOutOfRange => Fault::ForceOutOfRange,
            Self::Garbage | Self::FailedChecksum => Fault::CorruptMessages,
        }
    }
}

settings! {
    /// How many lapses in a row are survived; one more is a fault.
    ///
    /// A tick that overruns once may have met a rare branch; twice is a processor that is too
    /// slow. At 1 kHz the arm moves 10 mm in 20 ms at most. A sensor whose answer is disturbed is
    /// right again at the next tick, or broken.
    #[derive(Copy, Eq)]
    pub struct DeadlineLimits {
        /// Ticks in a row that may end late; one more is the fault `Overrun`.
        overruns: u32 = 1, 0..=100;
        /// Ticks in a row without a sensor frame; one more is the fault `FrameMissing`.
        missing_frames: u32 = 10, 0..=100;
        /// Stale frames in a row; one more is the fault `StaleFrame`.
        stale_frames: u32 = 5, 0..=100;
        /// Lost frames in a row; one more is the fault `FramesLost`.
        lost_frames: u32 = 5, 0..=100;
        /// Impossible readings in a row, of the encoders or of the force cell; one more is the
        /// fault `EncoderOutOfRange` or `ForceOutOfRange`.
        out_of_range_counts: u32 = 2, 0..=100;
        /// Unreadable messages in a row; one more is the fault `CorruptMessages`.
        garbage: u32 = 10, 0..=100;
        /// Failed checksums in a row; one more is the fault `CorruptMessages`.
        failed_checksums: u32 = 10, 0..=100;
    }
}

impl DeadlineLimits {
    fn of(&self, lapse: Lapse) -> u32 {
        match lapse {
            Lapse::Overrun => self.overruns,
            Lapse::MissingFrame => self.missing_frames,
            Lapse::StaleFrame => self.stale_frames,
            Lapse::LostFrame => self.lost_frames,
            Lapse::EncoderOutOfRange | Lapse::ForceOutOfRange => self.out_of_range_counts,
            Lapse::Garbage => self.garbage,
            Lapse::FailedChecksum => self.failed_checksums,
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
    counts: [Count; Lapse::COUNT],
}

impl DeadlineMonitor {
    /// A monitor that has seen nothing.
    pub fn new(limits: DeadlineLimits) -> Self {
        Self {
            limits,
            ..Self::default()
        }
    }

    /// Takes note that `lapse` did not happen this time.
    #[inline]
    pub fn note_good(&mut self, lapse: Lapse) {
        self.counts[lapse as usize].in_a_row = 0;
    }

    /// Takes note of how many times `lapse` happened; says whether that is now too often in a row.
    #[must_use]
    pub fn note_bad(&mut self, lapse: Lapse, times: u32) -> bool {
        let count = &mut self.counts[lapse as usize];
        count.total = count.total.wrapping_add(times);
        count.in_a_row = count.in_a_row.saturating_add(times);
        count.in_a_row > self.limits.of(lapse)
    }

    /// How often `lapse` has happened; wraps.
    pub fn total(&self, lapse: Lapse) -> u32 {
        self.counts[lapse as usize].total
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use painleve_shared::settings::Settings;

    const ALL: [Lapse; Lapse::COUNT] = [
        Lapse::Overrun,
        Lapse::MissingFrame,
        Lapse::StaleFrame,
        Lapse::LostFrame,
        Lapse::EncoderOutOfRange,
        Lapse::ForceOutOfRange,
        Lapse::Garbage,
        Lapse::FailedChecksum,
    ];

    #[test]
    fn each_kind_has_its_own_counter_and_limit_and_a_good_one_starts_over() {
        for lapse in ALL {
            let limits = DeadlineLimits::default();
            let limit = limits.of(lapse);
            let mut monitor = DeadlineMonitor::new(limits);
            for _ in 0..limit {
                assert!(!monitor.note_bad(lapse, 1), "{lapse:?}");
            }
            monitor.note_good(lapse);
            assert!(!monitor.note_bad(lapse, limit));
            for other in ALL.into_iter().filter(|other| *other != lapse) {
                assert!(!monitor.note_bad(other, 1));
                assert_eq!(monitor.total(other), 1);
            }
            assert!(monitor.note_bad(lapse, 1), "{lapse:?}");
            assert_eq!(monitor.total(lapse), 2 * limit + 1);
        }
    }

    #[test]
    fn totals_wrap_without_a_fault() {
        let mut monitor = DeadlineMonitor::default();
        monitor.counts[Lapse::MissingFrame as usize].total = u32::MAX;
        assert!(!monitor.note_bad(Lapse::MissingFrame, 1));
        assert_eq!(monitor.total(Lapse::MissingFrame), 0);
    }

    #[test]
    fn limits_are_checked_and_named() {
        let limits = DeadlineLimits {
            garbage: 101,
            ..Default::default()
        };
        let error = limits.validate().unwrap_err();
        assert_eq!(error.key, "garbage");
    }
}

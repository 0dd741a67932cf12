//! Lapses: what may go wrong with a tick, a sensor frame or a message, and is survived for a while.
//!
//! Each is declared once, below, with its limit and the fault that it becomes beyond the limit.

use serde::{Deserialize, Serialize};

use crate::settings;
use crate::status::Fault;

macro_rules! lapses {
    ($(
        $(#[doc = $origin_meaning:literal])+
        $origin:ident: {$(
            $(#[doc = $meaning:literal])+
            $lapse:ident => $key:ident = $limit:literal, $fault:ident;
        )+}
    )+) => {
        /// One kind of lapse.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(usize)]
        pub enum Lapse {
            $($(
                $(#[doc = $meaning])+
                $lapse,
            )+)+
        }

        impl Lapse {
            /// Every kind.
            pub const ALL: &[Self] = &[$($(Self::$lapse),+),+];

            $(
                $(#[doc = $origin_meaning])+
                pub const $origin: &[Self] = &[$(Self::$lapse),+];
            )+

            /// Name of the limit and of the counter.
            pub const fn key(self) -> &'static str {
                match self {
                    $($(Self::$lapse => stringify!($key)),+),+
                }
            }

            /// The fault that too many in a row become.
            pub const fn fault(self) -> Fault {
                match self {
                    $($(Self::$lapse => Fault::$fault),+),+
                }
            }
        }

        settings! {
            /// How many lapses of each kind are survived in a row; one more is a fault.
            ///
            /// A tick that overruns once may have met a rare branch; twice is a processor that is
            /// too slow. At 1 kHz the arm moves 10 mm in 20 ms at most. A sensor whose answer is
            /// disturbed is right again at the next tick, or broken.
            #[derive(Copy, Eq)]
            pub struct LapseLimits {
                $($(
                    $(#[doc = $meaning])+
                    $key: u32 = $limit, 0..=100;
                )+)+
            }
        }

        impl LapseLimits {
            /// The limit of one kind.
            pub const fn of(&self, lapse: Lapse) -> u32 {
                match lapse {
                    $($(Lapse::$lapse => self.$key),+),+
                }
            }
        }

        /// How often each lapse has happened. Counters wrap.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        pub struct LapseCounts {
            $($(
                $(#[doc = $meaning])+
                pub $key: u32,
            )+)+
        }

        impl LapseCounts {
            /// Counts that `count` gives for each kind.
            pub fn from_fn(count: impl Fn(Lapse) -> u32) -> Self {
                Self { $($($key: count(Lapse::$lapse)),+),+ }
            }
        }
    };
}

lapses! {
    /// Lapses of the control task.
    OF_TICKS: {
        /// Ticks that were not done when the next one was due.
        Overrun => overruns = 1, Overrun;
        /// Ticks without a sensor frame: it is late, or lost.
        MissingFrame => missing_frames = 10, MissingFrame;
    }
    /// Lapses detectable from a received sensor frame.
    OF_FRAMES: {
        /// Frames with the sequence number of an earlier one.
        StaleFrame => stale_frames = 5, StaleFrame;
        /// Sequence numbers that never came.
        LostFrame => lost_frames = 5, LostFrames;
        /// Frames with an encoder reading that the resolution does not allow.
        EncoderOutOfRange => encoder_out_of_range = 1, EncoderOutOfRange;
        /// Frames with a force reading that the resolution does not allow.
        ForceOutOfRange => force_out_of_range = 1, ForceOutOfRange;
    }
    /// Lapses of the link that carries messages as bytes.
    OF_MESSAGES: {
        /// Runs of bytes that are no message.
        Garbage => garbage = 10, CorruptMessages;
        /// Messages with a wrong checksum.
        FailedChecksum => failed_checksums = 10, CorruptMessages;
    }
}

impl Lapse {
    /// Number of kinds.
    pub const COUNT: usize = Self::ALL.len();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_lapse_has_its_own_limit_and_counter() {
        let counts = LapseCounts::from_fn(|lapse| lapse as u32);
        for (index, lapse) in Lapse::ALL.iter().enumerate() {
            assert_eq!(*lapse as usize, index);
            let mut limits = LapseLimits::default();
            let before = limits.of(*lapse);
            assert!(before > 0);
            match lapse {
                Lapse::Overrun => limits.overruns += 1,
                Lapse::FailedChecksum => limits.failed_checksums += 1,
                _ => continue,
            }
            assert_eq!(limits.of(*lapse), before + 1);
        }
        assert_eq!((counts.overruns, counts.failed_checksums), (0, 7));
    }
}

//! Lapses: errors of a tick, a sensor frame or a message that are tolerated up to a limit.
//!
//! Each is declared once, below, with its limit and the fault latched beyond the limit.

use postcard_schema::Schema;
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

            /// Returns the fault that is latched when too many occur.
            pub const fn fault(self) -> Fault {
                match self {
                    $($(Self::$lapse => Fault::$fault),+),+
                }
            }
        }

        settings! {
            /// Number of lapses of each kind tolerated in a row; one more latches the fault. Two good ticks make up
            /// for one lapse.
            ///
            /// One overrun may be a rare branch; two in a row mean that the processor is too slow.
            /// A sensor whose answer was disturbed recovers at the next tick, or is broken. In ten ticks of 1 kHz, a
            /// tip at 0.5 m/s moves by 5 mm.
            #[derive(Copy, Eq)]
            pub struct LapseLimits {
                $($(
                    $(#[doc = $meaning])+
                    $key: u32 = $limit, 0..=100;
                )+)+
            }
        }

        impl LapseLimits {
            /// Returns the limit of one kind.
            pub const fn of(&self, lapse: Lapse) -> u32 {
                match lapse {
                    $($(Lapse::$lapse => self.$key),+),+
                }
            }
        }

        /// Number of lapses of each kind. Counters wrap.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        pub struct LapseCounts {
            $($(
                $(#[doc = $meaning])+
                pub $key: u32,
            )+)+
        }

        impl LapseCounts {
            /// Returns the count of one kind.
            pub const fn of(&self, lapse: Lapse) -> u32 {
                match lapse {
                    $($(Lapse::$lapse => self.$key),+),+
                }
            }

            /// Returns the counts that `count` gives for each kind.
            pub fn from_fn(count: impl Fn(Lapse) -> u32) -> Self {
                Self { $($($key: count(Lapse::$lapse)),+),+ }
            }
        }
    };
}

lapses! {
    /// Lapses of the control task.
    OF_TICKS: {
        /// Ticks that were not finished when the next one was due.
        Overrun => overruns = 1, Overrun;
        /// Ticks without a sensor frame: the frame is late or lost.
        MissingFrame => missing_frames = 10, MissingFrame;
    }
    /// Lapses detectable from a received sensor frame.
    OF_FRAMES: {
        /// Frames with the sequence number of an earlier one.
        StaleFrame => stale_frames = 5, StaleFrame;
        /// Sequence numbers that were never received.
        LostFrame => lost_frames = 5, LostFrames;
        /// Frames with an encoder reading that the resolution does not allow.
        EncoderOutOfRange => encoder_out_of_range = 1, EncoderOutOfRange;
        /// Frames with a force reading that the resolution does not allow.
        ForceOutOfRange => force_out_of_range = 1, ForceOutOfRange;
        /// Frames of a board that refuses to arm.
        ArmingRefused => arming_refused = 1, ArmingRefused;
        /// Frames with a torque stage that is not ready.
        StageNotReady => stage_not_ready = 1, StageNotReady;
        /// Frames whose force cell contradicts the encoders or the torques.
        GapAgainstForce => gap_against_force = 5, GapAgainstForce;
        /// Frames with a winding that is too hot.
        WindingHot => winding_hot = 1, WindingTooHot;
    }
    /// Lapses of the link that carries messages as bytes.
    OF_MESSAGES: {
        /// Byte sequences that are not a message.
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
        assert_eq!((counts.overruns, counts.failed_checksums), (0, 11));
    }
}

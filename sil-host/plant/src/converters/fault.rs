//! Timed faults of single channels, of the kinds that PX4 injects: off, stuck, wrong, slow, delayed and intermittent.
//!
//! A fault acts on the counts of its channel from one time to another. The frame does not reveal
//! it; the controller has to detect it.

use std::collections::VecDeque;

use painleve_shared::{OutOfRange, range, settings};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Random stream of intermittent faults, separate from those of the noise channels.
const STREAM: u64 = 0x4661_756c_7473_0001;

settings! {
    /// Fault of one channel.
    #[derive(Copy)]
    pub enum ChannelFault by "kind" {
        /// None.
        "none" => None,
        /// The channel reads, or applies, zero counts.
        "off" => Off {
            /// Start.
            from_s: f64, 0.0..=1e7, "s";
            /// End.
            until_s: f64, 0.0..=1e7, "s";
        },
        /// The channel keeps its last value.
        "stuck" => Stuck {
            /// Start.
            from_s: f64, 0.0..=1e7, "s";
            /// End.
            until_s: f64, 0.0..=1e7, "s";
        },
        /// A constant is added; sums beyond the range saturate, and those of an encoder wrap around
        /// the turn.
        "wrong" => Wrong {
            /// Start.
            from_s: f64, 0.0..=1e7, "s";
            /// End.
            until_s: f64, 0.0..=1e7, "s";
            /// The constant as a fraction of full scale; of an encoder, of a turn.
            error: f64, -1.0..=1.0;
        },
        /// The value changes only once in a period.
        "slow" => Slow {
            /// Start.
            from_s: f64, 0.0..=1e7, "s";
            /// End.
            until_s: f64, 0.0..=1e7, "s";
            /// Period.
            period_s: f64, 1e-6..=1e3, "s";
        },
        /// The value is delayed by a constant time.
        "delayed" => Delayed {
            /// Start.
            from_s: f64, 0.0..=1e7, "s";
            /// End.
            until_s: f64, 0.0..=1e7, "s";
            /// The time, rounded to whole ticks.
            delay_s: f64, 0.0..=10.0, "s";
        },
        /// The channel is randomly off.
        "intermittent" => Intermittent {
            /// Start.
            from_s: f64, 0.0..=1e7, "s";
            /// End.
            until_s: f64, 0.0..=1e7, "s";
            /// Time for which the channel stays on or off before the next random draw.
            interval_s: f64, 1e-6..=1e3, "s";
            /// Probability that the channel is off.
            off_share: f64, 0.0..=1.0;
        },
    }
}

settings! {
    /// Faults of the channels between plant and controller.
    #[derive(Copy)]
    pub struct ChannelFaults {
        /// Encoder of joint 1.
        encoder_1: ChannelFault = ChannelFault::None;
        /// Encoder of joint 2.
        encoder_2: ChannelFault = ChannelFault::None;
        /// Normal force.
        normal_force: ChannelFault = ChannelFault::None;
        /// Tangential force.
        tangential_force: ChannelFault = ChannelFault::None;
        /// Torque stage of joint 1.
        torque_1: ChannelFault = ChannelFault::None;
        /// Torque stage of joint 2.
        torque_2: ChannelFault = ChannelFault::None;
    }
    check Self::relations;
}

impl ChannelFault {
    /// Returns start and end, s; `None` without a fault.
    #[inline]
    fn period_s(&self) -> Option<(f64, f64)> {
        match *self {
            Self::None => None,
            Self::Off { from_s, until_s }
            | Self::Stuck { from_s, until_s }
            | Self::Wrong {
                from_s, until_s, ..
            }
            | Self::Slow {
                from_s, until_s, ..
            }
            | Self::Delayed {
                from_s, until_s, ..
            }
            | Self::Intermittent {
                from_s, until_s, ..
            } => Some((from_s, until_s)),
        }
    }
}

impl ChannelFaults {
    fn relations(&self) -> Result<(), OutOfRange> {
        for (key, fault) in [
            ("encoder_1.until_s", &self.encoder_1),
            ("encoder_2.until_s", &self.encoder_2),
            ("normal_force.until_s", &self.normal_force),
            ("tangential_force.until_s", &self.tangential_force),
            ("torque_1.until_s", &self.torque_1),
            ("torque_2.until_s", &self.torque_2),
        ] {
            if let Some((from_s, until_s)) = fault.period_s() {
                range::check(key, until_s, from_s, 1e7)?;
            }
        }
        Ok(())
    }
}

/// One channel with its fault.
#[derive(Clone, Debug)]
pub struct FaultyChannel {
    fault: ChannelFault,
    /// Counts of full scale.
    full_scale: i64,
    generator: Pcg64,
    /// Value of a stuck or slow channel, or of a channel before its fault.
    held: Option<i64>,
    /// Time of the next change of a slow channel or of the next draw of an intermittent one, s.
    next_s: f64,
    is_off: bool,
    /// Past values of a delayed channel, the oldest first.
    history: VecDeque<i64>,
    delay_ticks: usize,
}

impl FaultyChannel {
    /// Creates a channel of `full_scale` counts that passes a value every `tick_s` seconds; `index`
    /// distinguishes channels with equal seeds.
    pub fn new(fault: &ChannelFault, full_scale: i64, tick_s: f64, seed: u64, index: u64) -> Self {
        let delay_ticks = match *fault {
            ChannelFault::Delayed { delay_s, .. } => (delay_s / tick_s).round() as usize,
            _ => 0,
        };
        let stream = STREAM ^ (index + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        Self {
            fault: *fault,
            full_scale,
            generator: Pcg64::seed_from_u64(seed ^ stream),
            held: None,
            next_s: f64::NEG_INFINITY,
            is_off: false,
            history: VecDeque::with_capacity(delay_ticks + 1),
            delay_ticks,
        }
    }

    /// Passes the value of a tick, counts; called once per tick. The result may be out of the channel's range.
    #[inline]
    pub fn pass(&mut self, time_s: f64, counts: i64) -> i64 {
        let Some((from_s, until_s)) = self.fault.period_s() else {
            return counts;
        };
        self.history.push_back(counts);
        if self.history.len() > self.delay_ticks + 1 {
            self.history.pop_front();
        }
        if time_s < from_s || time_s >= until_s {
            self.held = Some(counts);
            return counts;
        }
        match self.fault {
            ChannelFault::None => counts,
            ChannelFault::Off { .. } => 0,
            ChannelFault::Stuck { .. } => *self.held.get_or_insert(counts),
            ChannelFault::Wrong { error, .. } => {
                counts + (error * self.full_scale as f64).round() as i64
            }
            ChannelFault::Slow { period_s, .. } => {
                if time_s >= self.next_s {
                    self.next_s = self.next_s.max(from_s) + period_s;
                    self.held = Some(counts);
                }
                self.held.unwrap_or(counts)
            }
            ChannelFault::Delayed { .. } => self.history.front().copied().unwrap_or(counts),
            ChannelFault::Intermittent {
                interval_s,
                off_share,
                ..
            } => {
                if time_s >= self.next_s {
                    self.next_s = self.next_s.max(from_s) + interval_s;
                    self.is_off = self.generator.random::<f64>() < off_share;
                }
                if self.is_off { 0 } else { counts }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TICK_S: f64 = 0.001;

    /// Returns the output of a channel for the counts 100, 101, 102 … with a fault from 3 ms to
    /// 7 ms.
    fn passed(fault: ChannelFault) -> Vec<i64> {
        let mut channel = FaultyChannel::new(&fault, 1000, TICK_S, 1, 0);
        (0..10)
            .map(|tick| channel.pass(f64::from(tick) * TICK_S + 1e-9, 100 + i64::from(tick)))
            .collect()
    }

    #[test]
    fn each_kind_acts_from_its_start_to_its_end() {
        let (from_s, until_s) = (0.003, 0.007);
        let none = vec![100, 101, 102, 103, 104, 105, 106, 107, 108, 109];
        assert_eq!(passed(ChannelFault::None), none);
        let with = |during: [i64; 4]| [&none[..3], &during, &none[7..]].concat();
        for (fault, during) in [
            (ChannelFault::Off { from_s, until_s }, [0; 4]),
            (ChannelFault::Stuck { from_s, until_s }, [102; 4]),
            (
                ChannelFault::Wrong {
                    from_s,
                    until_s,
                    error: -0.2,
                },
                [-97, -96, -95, -94],
            ),
            (
                ChannelFault::Slow {
                    from_s,
                    until_s,
                    period_s: 0.002,
                },
                [103, 103, 105, 105],
            ),
            (
                ChannelFault::Delayed {
                    from_s,
                    until_s,
                    delay_s: 0.002,
                },
                [101, 102, 103, 104],
            ),
            (
                ChannelFault::Intermittent {
                    from_s,
                    until_s,
                    interval_s: 0.001,
                    off_share: 1.0,
                },
                [0; 4],
            ),
        ] {
            assert_eq!(passed(fault), with(during), "{fault:?}");
        }
    }

    #[test]
    fn a_channel_that_is_stuck_from_the_start_keeps_its_first_value() {
        let (from_s, until_s) = (0.0, 1.0);
        let stuck = passed(ChannelFault::Stuck { from_s, until_s });
        assert!(stuck.iter().all(|counts| *counts == 100), "{stuck:?}");
    }

    #[test]
    fn an_intermittent_channel_is_off_with_its_probability_and_repeatable() {
        let fault = ChannelFault::Intermittent {
            from_s: 0.0,
            until_s: 1e6,
            interval_s: 0.01,
            off_share: 0.3,
        };
        let values = |seed| {
            let mut channel = FaultyChannel::new(&fault, 1000, TICK_S, seed, 0);
            let pass = |tick| channel.pass(f64::from(tick) * TICK_S, 5);
            (0..100_000).map(pass).collect::<Vec<_>>()
        };
        let first = values(1);
        let off = first.iter().filter(|&&value| value == 0).count();
        assert!((28_000..32_000).contains(&off), "{off}");
        assert_eq!(first, values(1));
        assert_ne!(first, values(2));
        // The channel stays on or off for ten ticks.
        let changes = first.windows(2).filter(|pair| pair[0] != pair[1]).count();
        assert!(changes < 10_000 / 2, "{changes}");
    }

    #[test]
    fn an_end_before_the_start_is_refused_by_its_key() {
        let set = "converters.faults.torque_2={ kind = 'stuck', from_s = 2.0, until_s = 1.0 }";
        let error = crate::scenario::Scenario::load("edge", &[set.into()]).unwrap_err();
        let message = error.to_string();
        let key = "converters.faults.torque_2.until_s = 1";
        assert!(
            message.contains(key) && message.contains("2 to"),
            "{message}"
        );
    }
}

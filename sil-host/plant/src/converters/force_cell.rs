//! Two-axis force cell under the tip: samples the contact force at the tick.
//!
//! A collision of rigid bodies takes no time, so no sample falls into one: the cell measures the
//! forces between collisions, like a cell with a good anti-spike filter.

use std::collections::VecDeque;

use nalgebra::Vector2;
use painleve_shared::counts::{ForceCounts, LinearScale};
use painleve_shared::{OutOfRange, check_setting, settings};

use super::fault::{ChannelFaults, FaultyChannel};
use super::noise::{Channel, Noise};

/// Longest delay, ticks.
const MAXIMUM_DELAY_TICKS: usize = 100;

settings! {
    /// Settings of both axes of the force cell.
    #[derive(Copy)]
    pub struct ForceCellSettings {
        /// Resolution: 2^bits counts over the whole range.
        bits: u8 = 12, 4..=22, "bits";
        /// Full scale to either side; beyond it the reading saturates.
        range_n: f64 = 20.0, 1e-3..=1e6, "N";
        /// Standard deviation of the noise; at most `range_n`.
        noise_n: f64 = 0.02, 0.0..=1e6, "N";
        /// Constant error of f_t and of f_n.
        bias_n: [f64; 2] = [0.0; 2], -1e6..=1e6, "N";
        /// Rate at which a further error of each grows from zero.
        drift_n_s: [f64; 2] = [0.0; 2], -1e3..=1e3, "N/s";
        /// Relative error of the gain of f_t and of f_n.
        gain_error: [f64; 2] = [0.0; 2], -1.0..=10.0;
        /// Share of f_n that the reading of f_t contains, and share of f_t that the reading of f_n contains.
        cross_talk: [f64; 2] = [0.0; 2], -1.0..=1.0;
        /// Time constant of a low-pass on the force, before its zero and noise; 0 for none.
        low_pass_s: f64 = 0.0, 0.0..=10.0, "s";
        /// Whole control ticks from a sample to the frame that carries it.
        delay_ticks: u8 = 0, 0..=MAXIMUM_DELAY_TICKS as u8, "ticks";
    }
    check Self::relations;
}

impl ForceCellSettings {
    fn relations(&self) -> Result<(), OutOfRange> {
        check_setting!(self.noise_n, 0.0, self.range_n)
    }

    fn scale(&self) -> LinearScale<f64> {
        LinearScale {
            bits: self.bits,
            range: self.range_n,
        }
    }
}

/// The force cell with its errors and its noise.
#[derive(Clone, Debug)]
pub struct ForceCell {
    settings: ForceCellSettings,
    scale: LinearScale<f64>,
    /// Share of a new sample in the output of the low-pass.
    new_share: f64,
    /// Output of the low-pass, N; `None` before the first sample.
    filtered_n: Option<Vector2<f64>>,
    tangential_noise: Noise,
    normal_noise: Noise,
    /// Readings on their way, the oldest first.
    delayed: VecDeque<ForceReading>,
    /// Channels of f_t and f_n.
    channels: [FaultyChannel; 2],
}

/// Readings of both channels in one tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ForceReading {
    /// Reading of f_t.
    pub tangential: ForceCounts,
    /// Reading of f_n.
    pub normal: ForceCounts,
}

impl ForceCell {
    /// Creates a force cell that is sampled every `tick_s` seconds.
    pub fn new(
        settings: &ForceCellSettings,
        faults: &ChannelFaults,
        tick_s: f64,
        seed: u64,
    ) -> Self {
        let full_scale = i64::from(settings.scale().maximum_counts());
        let channel = |fault, index| FaultyChannel::new(fault, full_scale, tick_s, seed, index);
        Self {
            settings: *settings,
            scale: settings.scale(),
            new_share: if settings.low_pass_s > 0.0 {
                -libm::expm1(-tick_s / settings.low_pass_s)
            } else {
                1.0
            },
            filtered_n: None,
            tangential_noise: Noise::new(seed, Channel::TangentialForce, settings.noise_n),
            normal_noise: Noise::new(seed, Channel::NormalForce, settings.noise_n),
            channels: [
                channel(&faults.tangential_force, 2),
                channel(&faults.normal_force, 3),
            ],
            delayed: VecDeque::with_capacity(usize::from(settings.delay_ticks) + 1),
        }
    }

    /// Samples the contact force (f_t, f_n) in N at time `time_s`, once per tick, and returns the
    /// readings of this tick's frame.
    #[inline]
    pub fn read(&mut self, force_n: &Vector2<f64>, time_s: f64) -> ForceReading {
        let settings = &self.settings;
        let [gain_t, gain_n] = settings.gain_error.map(|error| 1.0 + error);
        let [into_t, into_n] = settings.cross_talk;
        let sensed = Vector2::new(
            gain_t * force_n.x + into_t * force_n.y,
            gain_n * force_n.y + into_n * force_n.x,
        );
        let filtered = match self.filtered_n {
            // Without a low-pass the sample must not be rounded.
            Some(before) if self.new_share < 1.0 => before + (sensed - before) * self.new_share,
            _ => sensed,
        };
        self.filtered_n = Some(filtered);
        let zero = Vector2::from(settings.bias_n) + Vector2::from(settings.drift_n_s) * time_s;
        let output = filtered + zero;
        let (tangential, _) = self.scale.counts(output.x + self.tangential_noise.draw());
        let (normal, _) = self.scale.counts(output.y + self.normal_noise.draw());
        let reading = ForceReading {
            tangential: ForceCounts(tangential),
            normal: ForceCounts(normal),
        };
        let reading = if settings.delay_ticks == 0 {
            reading
        } else {
            self.delayed.push_back(reading);
            // Before the first sample, the delay line holds the first reading.
            if self.delayed.len() > usize::from(settings.delay_ticks) {
                self.delayed.pop_front().unwrap_or(reading)
            } else {
                self.delayed.front().copied().unwrap_or(reading)
            }
        };
        let maximum = i64::from(self.scale.maximum_counts());
        let mut pass = |channel: usize, counts: ForceCounts| {
            let passed = self.channels[channel].pass(time_s, i64::from(counts.0));
            ForceCounts(passed.clamp(-maximum - 1, maximum) as i32)
        };
        ForceReading {
            tangential: pass(0, reading.tangential),
            normal: pass(1, reading.normal),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const TICK_S: f64 = 1e-3;
    /// Largest error of rounding to counts, N.
    const LSB_N: f64 = 40.0 / 4194304.0;

    /// Reads with fine counts and without noise; errors as given.
    fn cell(settings: ForceCellSettings) -> ForceCell {
        let fine = ForceCellSettings {
            bits: 22,
            noise_n: 0.0,
            ..settings
        };
        ForceCell::new(&fine, &ChannelFaults::default(), TICK_S, 1)
    }

    fn newtons(cell: &mut ForceCell, force_n: [f64; 2], time_s: f64) -> [f64; 2] {
        let reading = cell.read(&Vector2::from(force_n), time_s);
        [reading.tangential, reading.normal].map(|counts| cell.scale.value(counts.0))
    }

    #[test]
    fn readings_round_to_the_nearest_count_and_saturate() {
        let settings = ForceCellSettings {
            noise_n: 0.0,
            ..Default::default()
        };
        let mut cell = ForceCell::new(&settings, &ChannelFaults::default(), TICK_S, 1);
        let reading = cell.read(&Vector2::new(-100.0, 10.0), 0.0);
        assert_eq!(reading.tangential, ForceCounts(-2048));
        assert_eq!(reading.normal, ForceCounts(1024));
    }

    proptest! {
        #[test]
        fn bias_drift_gain_and_cross_talk_are_linear(
            force_t in -3.0_f64..3.0, force_n in 0.0_f64..3.0, time_s in 0.0_f64..5.0,
            bias in -1.0_f64..1.0, drift in -0.2_f64..0.2, gain in -0.5_f64..0.5, talk in -0.3_f64..0.3,
        ) {
            let mut cell = cell(ForceCellSettings {
                bias_n: [bias, -bias],
                drift_n_s: [0.0, drift],
                gain_error: [gain, 0.5 * gain],
                cross_talk: [talk, -0.5 * talk],
                ..Default::default()
            });
            let [t, n] = newtons(&mut cell, [force_t, force_n], time_s);
            let expected_t = (1.0 + gain) * force_t + talk * force_n + bias;
            let expected_n =
                (1.0 + 0.5 * gain) * force_n - 0.5 * talk * force_t - bias + drift * time_s;
            prop_assert!((t - expected_t).abs() < LSB_N, "{} {}", t, expected_t);
            prop_assert!((n - expected_n).abs() < LSB_N, "{} {}", n, expected_n);
        }

        #[test]
        fn the_low_pass_answers_a_step_by_an_exponential(low_pass_s in 1e-4_f64..0.1) {
            let mut cell = cell(ForceCellSettings { low_pass_s, ..Default::default() });
            newtons(&mut cell, [0.0, 0.0], 0.0);
            for tick in 1..=50 {
                let time_s = f64::from(tick) * TICK_S;
                let [_, n] = newtons(&mut cell, [0.0, 2.0], time_s);
                let expected = 2.0 * (1.0 - libm::exp(-time_s / low_pass_s));
                prop_assert!((n - expected).abs() < 2.0 * LSB_N, "{} {}", n, expected);
            }
        }
    }

    #[test]
    fn readings_are_late_by_whole_ticks() {
        let mut cell = cell(ForceCellSettings {
            delay_ticks: 3,
            ..Default::default()
        });
        let mut read = |value: i32| newtons(&mut cell, [0.0, f64::from(value)], 0.0)[1].round();
        let readings: Vec<f64> = (1..=7).map(&mut read).collect();
        assert_eq!(readings, [1.0, 1.0, 1.0, 1.0, 2.0, 3.0, 4.0]);
    }
}

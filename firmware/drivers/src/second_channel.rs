//! Compares two sensors of one quantity, so that one that stops following is found although each of its readings
//! is plausible.
//!
//! Two sensors differ by a constant, by their noise, and by their nonlinearity or gain. The constant is measured
//! while the drive is off. While it is on, the difference may change by a sixteenth of the motion that both
//! sensors show: two AS5048A whose nonlinearity of ±0.8° (DS000298) is a second harmonic differ in slope by
//! 2 × 2 × 0.8° a radian, 5.6 %, and the gains of two force cells by a few per cent. A sensor that repeats its
//! reading shows no motion, so that the difference may only be noise.

use crate::ReadError;

/// Parts of a count.
const PARTS: i32 = 16;

/// By how much two sensors may differ.
#[derive(Clone, Copy, Debug)]
pub struct Tolerance {
    /// By noise, counts.
    pub noise: u16,
    /// By nonlinearity or gain over the whole range, counts: how far the difference may move away from where it
    /// was when the drive was switched on.
    pub range: u16,
}

/// Two sensors of one quantity.
#[derive(Clone, Copy, Debug, Default)]
pub struct SecondChannel {
    /// Difference of the sensors, 1/16 counts.
    offset: i32,
    /// The difference when the drive was switched on, 1/16 counts.
    offset_at_start: i32,
    /// The last readings, counts.
    last: [i32; 2],
}

impl SecondChannel {
    /// Compares readings of the same time, counts in the same direction, that count modulo 2¹⁴ or less than that.
    /// Returns whether the second confirms the first. While the drive is off (`drives` false) it does whenever
    /// there are two.
    pub fn confirms(
        &mut self,
        readings: [Result<i32, ReadError>; 2],
        tolerance: Tolerance,
        drives: bool,
    ) -> bool {
        let [Ok(first), Ok(second)] = readings else {
            return false;
        };
        let [last_first, last_second] = self.last;
        self.last = [first, second];
        let moved = in_parts(first - last_first)
            .abs()
            .min(in_parts(second - last_second).abs());
        let noise = PARTS * i32::from(tolerance.noise);
        let apart = wrapped(in_parts(first - second) - self.offset);
        if !drives {
            let is_new = apart.abs() > noise;
            self.offset = wrapped(self.offset + if is_new { apart } else { apart / PARTS });
            self.offset_at_start = self.offset;
            return true;
        }
        let follows = moved / 16;
        let range = PARTS * i32::from(tolerance.range);
        let drift = wrapped(self.offset - self.offset_at_start) + apart.clamp(-follows, follows);
        self.offset = wrapped(self.offset_at_start + drift.clamp(-range, range));
        // The sensors are read some microseconds after each other.
        apart.abs() <= noise + moved / 8
    }
}

/// Returns a difference of counts modulo 2¹⁴, in 1/16 counts.
fn in_parts(counts: i32) -> i32 {
    wrapped(counts * PARTS)
}

/// Wraps 1/16 counts to half a turn on either side.
fn wrapped(parts: i32) -> i32 {
    (parts << 14) >> 14
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOLERANCE: Tolerance = Tolerance {
        noise: 23,
        range: 146,
    };

    /// Noise of at most three counts.
    fn noise(tick: i32) -> i32 {
        (tick * 7919 + 13).rem_euclid(7) - 3
    }

    /// Nonlinearity of ±0.8°, a second harmonic with this phase, rad.
    fn nonlinear(angle: f64, phase: f64) -> i32 {
        let turn = 16384.0;
        let rad = angle / turn * std::f64::consts::TAU;
        let error = 0.8 / 360.0 * turn * (2.0 * rad + phase).sin();
        (angle + error) as i32
    }

    fn confirms(channel: &mut SecondChannel, first: i32, second: i32, drives: bool) -> bool {
        channel.confirms([Ok(first & 0x3fff), Ok(second & 0x3fff)], TOLERANCE, drives)
    }

    /// Turns by `speed` counts a tick for `ticks`, after a while at rest with the drive off.
    fn turned(speed: f64, ticks: i32) -> (SecondChannel, bool) {
        let mut channel = SecondChannel::default();
        let mut is_confirmed = true;
        for tick in 0..200 + ticks {
            let drives = tick >= 200;
            let angle = 3000.0 + speed * f64::from((tick - 200).max(0));
            let first = nonlinear(angle, 0.0) + noise(tick);
            let second = nonlinear(angle + 12_000.0, 2.0) + noise(3 * tick + 1);
            is_confirmed &= confirms(&mut channel, first, second, drives);
        }
        (channel, is_confirmed)
    }

    #[test]
    fn two_healthy_encoders_confirm_each_other_at_every_speed() {
        for speed in [0.0, 0.01, 0.3, 2.0, 10.0, 50.0, -7.0] {
            let (_, is_confirmed) = turned(speed, 20_000);
            assert!(is_confirmed, "{speed}");
        }
    }

    #[test]
    fn an_encoder_that_repeats_its_angle_is_found_once_the_joint_has_left_the_tolerance() {
        for (speed, frozen) in [(0.05, 0), (0.05, 1), (1.0, 0), (3.0, 1), (-20.0, 0)] {
            let (mut channel, _) = turned(speed, 100);
            let [first, second] = channel.last;
            let mut tick = 0;
            let mut is_confirmed = true;
            while is_confirmed {
                tick += 1;
                let angle = (speed * f64::from(tick)) as i32;
                let moving = |at: i32, is_frozen: bool| if is_frozen { at } else { at + angle };
                let first = moving(first, frozen == 0);
                let second = moving(second, frozen == 1);
                is_confirmed = confirms(&mut channel, first, second, true);
                assert!(tick < 10_000);
            }
            // The readings before were themselves apart by their noise and by what had not been followed yet.
            let travel = speed.abs() * f64::from(tick);
            assert!(
                travel < 2.0 * 23.0 + 2.0 * speed.abs() + 2.0,
                "{speed} {travel}"
            );
        }
    }

    #[test]
    fn a_slipping_magnet_with_noise_is_found() {
        let (mut channel, _) = turned(0.0, 100);
        let [first, second] = channel.last;
        let mut tick = 0;
        let mut is_confirmed = true;
        while is_confirmed {
            tick += 1;
            let angle = tick / 10;
            is_confirmed = confirms(&mut channel, first + noise(tick), second + angle, true);
            assert!(angle < 2 * 23 + 146);
        }
    }

    #[test]
    fn a_gain_that_differs_by_three_per_cent_is_no_failure() {
        let mut channel = SecondChannel::default();
        for tick in 0..20_000 {
            let force = 900.0 + 800.0 * (f64::from(tick) * 0.01).sin();
            let readings = [force, 1.03 * force].map(|it| Ok(it as i32 + noise(tick)));
            assert!(channel.confirms(readings, TOLERANCE, tick >= 100), "{tick}");
        }
    }

    #[test]
    fn without_a_second_reading_the_first_is_not_confirmed() {
        let mut channel = SecondChannel::default();
        let readings = [Ok(5), Err(ReadError::Bus)];
        assert!(!channel.confirms(readings, TOLERANCE, false));
        assert!(!channel.confirms(readings, TOLERANCE, true));
    }
}

//! Absolute single-turn joint encoders on θ1 and on the elbow, θ2 − θ1.
//!
//! Latency is exact: the plant stops at the instant of capture, which accounts for the part of the
//! latency below one tick; whole ticks wait in a ring buffer.

use painleve_shared::counts::{EncoderCounts, EncoderScale};
use painleve_shared::{LinkMotion, OutOfRange, check_setting, settings};

use super::noise::{Channel, Noise};

/// Longest latency, in whole ticks.
const MAXIMUM_LATENCY_TICKS: usize = 16;

settings! {
    /// Settings of both joint encoders.
    #[derive(Copy)]
    pub struct EncoderSettings {
        /// Resolution: 2^bits counts a turn.
        bits: u8 = 14, 8..=24, "bits";
        /// Reading at angle zero; less than a turn.
        offset_counts: [u32; 2] = [0, 0], 0..=(1 << 24) - 1, "counts";
        /// Standard deviation of the noise.
        noise_rad: f64 = 0.0, 0.0..=0.1, "rad";
        /// Time from capture to the frame that carries it, in control ticks.
        latency_ticks: f64 = 0.0, 0.0..=MAXIMUM_LATENCY_TICKS as f64 - 1.0, "ticks";
    }
    check Self::relations;
}

impl EncoderSettings {
    fn relations(&self) -> Result<(), OutOfRange> {
        let [scale, _] = self.scales();
        check_setting!(self.offset_counts, 0, scale.modulus() - 1)
    }
}

/// Both encoders with their noise and the readings in transit.
#[derive(Clone, Debug)]
pub struct Encoders {
    scales: [EncoderScale; 2],
    noise: [Noise; 2],
    whole_ticks: usize,
    fraction: f64,
    /// Ring buffer of captured readings.
    captured: [[EncoderCounts; 2]; MAXIMUM_LATENCY_TICKS],
    next: usize,
}

impl Encoders {
    /// Creates encoders whose past readings all show the arm at rest at link angles `theta_rad`.
    pub fn new(settings: &EncoderSettings, seed: u64, theta_rad: &LinkMotion<f64>) -> Self {
        let mut encoders = Self {
            scales: settings.scales(),
            noise: [Channel::Encoder1, Channel::Encoder2]
                .map(|channel| Noise::new(seed, channel, settings.noise_rad)),
            whole_ticks: settings.latency_ticks as usize,
            fraction: settings.latency_ticks.fract(),
            captured: [[EncoderCounts(0); 2]; MAXIMUM_LATENCY_TICKS],
            next: 0,
        };
        for _ in 0..MAXIMUM_LATENCY_TICKS {
            encoders.capture(theta_rad);
        }
        encoders
    }

    /// Returns how long before a tick the encoders capture for it, in ticks, 0 … 1.
    pub fn capture_before_tick(&self) -> f64 {
        self.fraction
    }

    /// Captures the link angles, rad; called once per tick.
    pub fn capture(&mut self, theta_rad: &LinkMotion<f64>) {
        let joints: [f64; 2] = theta_rad.to_joints().into();
        let mut readings = [EncoderCounts(0); 2];
        for (joint, reading) in readings.iter_mut().enumerate() {
            let angle = joints[joint] + self.noise[joint].draw();
            *reading = self.scales[joint].reading(angle);
        }
        self.captured[self.next] = readings;
        self.next = (self.next + 1) % MAXIMUM_LATENCY_TICKS;
    }

    /// Returns the readings carried by this tick's frame.
    pub fn readings(&self) -> [EncoderCounts; 2] {
        let behind = self.whole_ticks + 1;
        let index = (self.next + MAXIMUM_LATENCY_TICKS - behind) % MAXIMUM_LATENCY_TICKS;
        self.captured[index]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readings_show_the_elbow_angle_with_latency() {
        let settings = EncoderSettings {
            latency_ticks: 2.25,
            ..Default::default()
        };
        let mut encoders = Encoders::new(&settings, 1, &LinkMotion::zeros());
        assert_eq!(encoders.capture_before_tick(), 0.25);
        for tick in 1..=5 {
            encoders.capture(&LinkMotion::new(0.1 * f64::from(tick), 0.5));
        }
        let scale = encoders.scales[0];
        let expected = [scale.reading(0.3), scale.reading(0.5 - 0.3)];
        assert_eq!(encoders.readings(), expected);
    }
}

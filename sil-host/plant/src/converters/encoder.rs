//! Absolute single-turn joint encoders on θ1 and on the elbow, θ2 − θ1.
//!
//! Latency is exact: the plant stops at the instant of capture, which accounts for the part of the
//! latency below one tick; whole ticks wait in a ring buffer.

use core::f64::consts::PI;

use painleve_firmware::estimate::encoder_correction::EncoderCorrection;
use painleve_shared::counts::{EncoderCounts, EncoderScale};
use painleve_shared::{JointMotion, LinkMotion, OutOfRange, Pose, check_setting, settings};

use super::fault::{ChannelFaults, FaultyChannel};
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
        /// Constant error of each joint angle, unknown to the controller.
        mounting_error_rad: [f64; 2] = [0.0; 2], -0.5..=0.5, "rad";
        /// Amplitude of the error, once around in a turn, of a disc that is mounted off its centre.
        eccentricity_rad: [f64; 2] = [0.0; 2], 0.0..=0.1, "rad";
        /// Phase of this error: the sine's argument at joint angle zero.
        eccentricity_phase_rad: [f64; 2] = [0.0; 2], -PI..=PI, "rad";
        /// Amplitude of the error twice around in a turn, as of a magnet at an angle.
        second_harmonic_rad: [f64; 2] = [0.0; 2], 0.0..=0.1, "rad";
        /// Phase of this error: the sine's argument at joint angle zero.
        second_harmonic_phase_rad: [f64; 2] = [0.0; 2], -PI..=PI, "rad";
    }
    check Self::relations;
}

impl EncoderSettings {
    fn relations(&self) -> Result<(), OutOfRange> {
        let [scale, _] = self.scales();
        check_setting!(self.offset_counts, 0, scale.modulus() - 1)
    }

    /// Returns the error of the encoder of joint 0 or 1 at a joint angle, rad.
    #[inline]
    fn error_rad(&self, joint: usize, angle_rad: f64) -> f64 {
        let mut error_rad = self.mounting_error_rad[joint];
        for (times, amplitude_rad, phase_rad) in [
            (1.0, self.eccentricity_rad, self.eccentricity_phase_rad),
            (
                2.0,
                self.second_harmonic_rad,
                self.second_harmonic_phase_rad,
            ),
        ] {
            if amplitude_rad[joint] != 0.0 {
                error_rad += amplitude_rad[joint] * libm::sin(times * angle_rad + phase_rad[joint]);
            }
        }
        error_rad
    }
}

/// Both encoders with their noise and the readings in transit.
#[derive(Clone, Debug)]
pub struct Encoders {
    settings: EncoderSettings,
    scales: [EncoderScale; 2],
    noise: [Noise; 2],
    whole_ticks: usize,
    fraction: f64,
    /// Ring buffer of captured readings.
    captured: [[EncoderCounts; 2]; MAXIMUM_LATENCY_TICKS],
    next: usize,
    channels: [FaultyChannel; 2],
}

impl Encoders {
    /// Creates encoders whose past readings all show the arm at rest at link angles `theta_rad`.
    pub fn new(
        settings: &EncoderSettings,
        faults: &ChannelFaults,
        tick_s: f64,
        seed: u64,
        theta_rad: &LinkMotion<f64>,
    ) -> Self {
        let turn = i64::from(settings.scales()[0].modulus());
        let channel = |fault, index| FaultyChannel::new(fault, turn, tick_s, seed, index);
        let mut encoders = Self {
            settings: *settings,
            channels: [channel(&faults.encoder_1, 0), channel(&faults.encoder_2, 1)],
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
    #[inline]
    pub fn capture_before_tick(&self) -> f64 {
        self.fraction
    }

    /// Captures the link angles, rad; called once per tick.
    #[inline]
    pub fn capture(&mut self, theta_rad: &LinkMotion<f64>) {
        let joints = theta_rad.to_joints().to_array();
        let mut readings = [EncoderCounts(0); 2];
        for (joint, reading) in readings.iter_mut().enumerate() {
            let error_rad = self.settings.error_rad(joint, joints[joint]);
            let angle = joints[joint] + error_rad + self.noise[joint].draw();
            *reading = self.scales[joint].reading(angle);
        }
        self.captured[self.next] = readings;
        self.next = (self.next + 1) % MAXIMUM_LATENCY_TICKS;
    }

    /// Returns the readings carried by this tick's frame.
    /// `time_s` is the time of the tick; called once per tick.
    #[inline]
    pub fn readings(&mut self, time_s: f64) -> [EncoderCounts; 2] {
        let behind = self.whole_ticks + 1;
        let index = (self.next + MAXIMUM_LATENCY_TICKS - behind) % MAXIMUM_LATENCY_TICKS;
        let mut readings = self.captured[index];
        for (joint, reading) in readings.iter_mut().enumerate() {
            let passed = self.channels[joint].pass(time_s, i64::from(reading.0));
            // A turn is a power of two.
            reading.0 = (passed & i64::from(self.scales[joint].modulus() - 1)) as u32;
        }
        readings
    }
}

/// Returns the link angles, rad, that readings of encoders (rad) show with this correction, without a prediction.
pub fn links_rad(correction: &EncoderCorrection, encoders_rad: [f64; 2]) -> LinkMotion<f64> {
    let encoders = JointMotion::from_array(encoders_rad.map(|angle| angle as f32));
    // As the tracking loops start, and once more: a correction of 10 mrad changes by a thirtieth of the angle's error at most.
    let mut added_rad = JointMotion::from_array(correction.zero_rad);
    for _ in 0..2 {
        added_rad = correction.in_pose(&Pose::new(&(encoders + added_rad).to_links()));
    }
    let [one, two] = added_rad.to_array().map(f64::from);
    JointMotion::new(encoders_rad[0] + one, encoders_rad[1] + two).to_links()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::array::uniform2;
    use proptest::prelude::*;

    fn encoders(settings: &EncoderSettings, theta_rad: &LinkMotion<f64>) -> Encoders {
        Encoders::new(settings, &ChannelFaults::default(), 1e-3, 1, theta_rad)
    }

    proptest! {
        #[test]
        fn readings_with_known_errors_show_the_links(
            zero_rad in uniform2(-0.1_f32..0.1), sine_rad in uniform2(-0.02_f32..0.02), cosine_rad in uniform2(-0.02_f32..0.02),
            second_sine_rad in uniform2(-0.01_f32..0.01), second_cosine_rad in uniform2(-0.01_f32..0.01),
            first in -1.5_f32..1.5, elbow in -3.0_f32..3.0,
        ) {
            let correction = EncoderCorrection {
                zero_rad, sine_rad, cosine_rad, second_sine_rad, second_cosine_rad,
            };
            let added = correction.in_pose(&Pose::new(&LinkMotion::new(first, first + elbow)));
            let added = added.to_array();
            let found = links_rad(&correction, [first - added[0], elbow - added[1]].map(f64::from));
            prop_assert!((found.to_joints().first() - f64::from(first)).abs() < 2e-4);
            prop_assert!((found.to_joints().second() - f64::from(elbow)).abs() < 2e-4);
        }

        #[test]
        fn errors_are_a_constant_and_sines_of_the_joint_angle_once_and_twice_around(
            mounting in -0.1_f64..0.1, eccentricity in 0.0_f64..0.01, phase in -3.0_f64..3.0,
            second in 0.0_f64..0.01, first in -1.0_f64..1.0, elbow in -1.0_f64..1.0,
        ) {
            let errors = EncoderSettings {
                bits: 24,
                mounting_error_rad: [mounting, 0.0],
                eccentricity_rad: [0.0, eccentricity],
                eccentricity_phase_rad: [0.0, phase],
                second_harmonic_rad: [second, 0.0],
                second_harmonic_phase_rad: [phase, 0.0],
                ..Default::default()
            };
            let mut encoders = encoders(&errors, &LinkMotion::new(first, first + elbow));
            let readings = encoders.readings(0.0);
            let twice = second * libm::sin(2.0 * first + phase);
            let expected = [first + mounting + twice, elbow + eccentricity * libm::sin(elbow + phase)];
            for ((scale, reading), angle) in
                encoders.scales.iter().zip(readings).zip(expected)
            {
                let apart = reading.0.abs_diff(scale.reading(angle).0);
                prop_assert!(apart <= 1, "{} counts", apart);
            }
        }
    }

    #[test]
    fn readings_show_the_elbow_angle_with_latency() {
        let settings = EncoderSettings {
            latency_ticks: 2.25,
            ..Default::default()
        };
        let mut encoders = encoders(&settings, &LinkMotion::zeros());
        assert_eq!(encoders.capture_before_tick(), 0.25);
        for tick in 1..=5 {
            encoders.capture(&LinkMotion::new(0.1 * f64::from(tick), 0.5));
        }
        let scale = encoders.scales[0];
        let expected = [scale.reading(0.3), scale.reading(0.5 - 0.3)];
        assert_eq!(encoders.readings(0.0), expected);
    }
}

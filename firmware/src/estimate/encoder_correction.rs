//! Corrects the encoders: their zeros, and their errors once and twice around in a turn.
//!
//! A magnet off its shaft's centre gives an error once around, a magnet at an angle one twice around. The correction of
//! the next readings is evaluated where the model predicts the joints, from the sines and cosines that it has there; the
//! readings then add a number. They differ from the prediction by a fraction of a milliradian, which changes a correction
//! of 10 mrad by 10⁻⁵ rad at most.

use painleve_shared::{JointMotion, Pose, Real, settings};

settings! {
    /// What is added to the angle q of each joint's encoder:
    /// zero + sine · sin q + cosine · cos q + second_sine · sin 2q + second_cosine · cos 2q.
    #[derive(Copy)]
    pub struct EncoderCorrection {
        /// Constant that is added to each encoder's angle.
        zero_rad: [f32; 2] = [0.0; 2], -0.2..=0.2, "rad";
        /// Amplitude of the sine of each joint's angle that is added to it.
        sine_rad: [f32; 2] = [0.0; 2], -0.1..=0.1, "rad";
        /// The same of the cosine.
        cosine_rad: [f32; 2] = [0.0; 2], -0.1..=0.1, "rad";
        /// The same of the sine of twice the angle.
        second_sine_rad: [f32; 2] = [0.0; 2], -0.1..=0.1, "rad";
        /// The same of the cosine of twice the angle.
        second_cosine_rad: [f32; 2] = [0.0; 2], -0.1..=0.1, "rad";
    }
}

/// The correction of one encoder as a polynomial in sine s and cosine c of its joint's angle: with sin 2q = 2 s c and
/// cos 2q = 1 − 2 s², k + s (a + b c + d s) + e c.
#[derive(Clone, Copy, Debug)]
struct Polynomial {
    constant: f32,
    sine: f32,
    sine_cosine: f32,
    square: f32,
    cosine: f32,
}

impl Polynomial {
    #[inline(always)]
    fn at(&self, sine: f32, cosine: f32) -> f32 {
        let slope = self.sine + self.sine_cosine * cosine + self.square * sine;
        self.constant + sine * slope + self.cosine * cosine
    }
}

/// The correction of both encoders.
#[derive(Clone, Copy, Debug)]
pub struct EncoderCorrector {
    /// Whether there is anything to correct.
    is_active: bool,
    polynomials: [Polynomial; 2],
}

impl EncoderCorrector {
    /// Creates the corrector with these settings.
    pub fn new(settings: &EncoderCorrection) -> Self {
        let polynomial = |joint: usize| Polynomial {
            constant: settings.zero_rad[joint] + settings.second_cosine_rad[joint],
            sine: settings.sine_rad[joint],
            sine_cosine: 2.0 * settings.second_sine_rad[joint],
            square: -2.0 * settings.second_cosine_rad[joint],
            cosine: settings.cosine_rad[joint],
        };
        Self {
            is_active: *settings != EncoderCorrection::default(),
            polynomials: [polynomial(0), polynomial(1)],
        }
    }

    /// Returns the corrections (rad) in a pose; `None` if there is nothing to correct.
    #[inline]
    pub fn in_pose(&self, pose: &Pose<f32>) -> Option<JointMotion<f32>> {
        if !self.is_active {
            return None;
        }
        let [first, elbow] = &self.polynomials;
        Some(JointMotion::new(
            first.at(pose.sine.x, pose.cosine.x),
            elbow.at(pose.sine_elbow(), pose.cosine_elbow()),
        ))
    }

    /// Returns the corrections (rad) at angles of the encoders (rad).
    pub fn at(&self, angles_rad: [f32; 2]) -> [f32; 2] {
        let mut corrections_rad = [0.0; 2];
        if self.is_active {
            for (joint, correction_rad) in corrections_rad.iter_mut().enumerate() {
                let polynomial = &self.polynomials[joint];
                let at = |angle_rad: f32| {
                    let (sine, cosine) = angle_rad.sine_cosine();
                    polynomial.at(sine, cosine)
                };
                // Once more with the first correction: a zero may be off by some degrees.
                *correction_rad = at(angles_rad[joint] + at(angles_rad[joint]));
            }
        }
        corrections_rad
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimate::joints::{JointEstimator, JointEstimatorSettings};
    use painleve_shared::counts::EncoderScale;
    use painleve_shared::{JointTorque, LinkMotion};
    use proptest::prelude::*;

    fn pair(limit: f32) -> impl Strategy<Value = [f32; 2]> {
        [-limit..limit, -limit..limit]
    }

    proptest! {
        #[test]
        fn a_correction_is_its_constant_and_two_harmonics_of_the_joints_angle(
            zero_rad in pair(0.1), sine_rad in pair(0.02), cosine_rad in pair(0.02),
            second_sine_rad in pair(0.01), second_cosine_rad in pair(0.01),
            first in -1.5_f32..1.5, elbow in -3.0_f32..3.0,
        ) {
            let corrector = EncoderCorrector::new(&EncoderCorrection {
                zero_rad, sine_rad, cosine_rad, second_sine_rad, second_cosine_rad,
            });
            let found = corrector.in_pose(&Pose::new(&LinkMotion::new(first, first + elbow))).unwrap();
            let found = found.to_array();
            for (joint, angle) in [first, elbow].into_iter().enumerate() {
                let twice = 2.0 * angle;
                let expected = zero_rad[joint]
                    + sine_rad[joint] * angle.sin() + cosine_rad[joint] * angle.cos()
                    + second_sine_rad[joint] * twice.sin() + second_cosine_rad[joint] * twice.cos();
                prop_assert!((found[joint] - expected).abs() < 1e-6, "{} {}", found[joint], expected);
            }
            // From the readings of these joints, the same to second order: a correction changes by 0.057 of the angle's
            // error at most, twice, and is 0.14 at most.
            let readings = [first - found[0], elbow - found[1]];
            let again = corrector.at(readings);
            for (one, other) in again.into_iter().zip(found) {
                prop_assert!((one - other).abs() < 5e-4, "{} {}", one, other);
            }
        }
    }

    #[test]
    fn with_known_errors_of_the_encoders_the_loops_follow_the_joints() {
        let encoders = EncoderCorrection {
            zero_rad: [0.04, -0.03],
            sine_rad: [0.005, -0.004],
            second_cosine_rad: [-0.002, 0.001],
            ..Default::default()
        };
        let settings = JointEstimatorSettings {
            encoders,
            ..Default::default()
        };
        let scale = EncoderScale::default();
        let mut estimator = JointEstimator::new(&settings, [scale; 2], 1000.0);
        let corrector = EncoderCorrector::new(&encoders);
        let still = JointMotion::zeros();
        for tick in 0..600_u16 {
            let time_s = 1e-3 * f32::from(tick);
            let joints = JointMotion::new(-0.4 + 1.5 * time_s, 0.9 - 2.0 * time_s);
            let truth = joints.to_links();
            let added = corrector.in_pose(&Pose::new(&truth)).unwrap();
            let readings = (joints - added)
                .to_array()
                .map(|angle| scale.reading(f64::from(angle)));
            let _ = estimator.correct(&readings, 1, &still, &JointTorque::zeros());
            let error = (estimator.angles_rad() - joints).amax();
            let most = if tick < 100 { 0.02 } else { 6e-4 };
            assert!(error < most, "{tick}: {error}");
            estimator.predict(&still);
            let pose = Pose::new(&estimator.theta_rad());
            estimator.expect_pose(&pose);
        }
    }

    #[test]
    fn no_correction_is_none() {
        let corrector = EncoderCorrector::new(&EncoderCorrection::default());
        let pose = Pose::new(&LinkMotion::new(0.3, 0.7));
        assert!(corrector.in_pose(&pose).is_none());
        assert_eq!(corrector.at([0.3, 0.7]), [0.0; 2]);
    }
}

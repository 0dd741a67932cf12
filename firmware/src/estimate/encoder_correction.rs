//! Corrects the encoders: their zeros, and their errors once and twice around in a turn.
//!
//! A magnet off its shaft's centre gives an error once around, a magnet at an angle one twice around. The correction of
//! the next readings is evaluated where the model predicts the joints, from the sines and cosines that it has there; the
//! readings then add a number. They differ from the prediction by a fraction of a milliradian, which changes a correction
//! of 10 mrad by 10⁻⁵ rad at most.

use painleve_shared::{JointMotion, Pose, settings};

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

impl EncoderCorrection {
    /// Returns the corrections of both encoders in a pose, rad, with sin 2q = 2 s c and cos 2q = 1 − 2 s².
    #[inline]
    pub fn in_pose(&self, pose: &Pose<f32>) -> JointMotion<f32> {
        let at = |joint: usize, sine: f32, cosine: f32| {
            let second_cosine_rad = self.second_cosine_rad[joint];
            let twice = self.second_sine_rad[joint] * cosine - second_cosine_rad * sine;
            self.zero_rad[joint]
                + second_cosine_rad
                + sine * (self.sine_rad[joint] + 2.0 * twice)
                + self.cosine_rad[joint] * cosine
        };
        JointMotion::new(
            at(0, pose.sine.x, pose.cosine.x),
            at(1, pose.sine_elbow(), pose.cosine_elbow()),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimate::joints::{JointEstimator, JointEstimatorSettings};
    use painleve_shared::counts::EncoderScale;
    use painleve_shared::{JointTorque, LinkMotion};
    use proptest::array::uniform2;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_correction_is_its_constant_and_two_harmonics_of_the_joints_angle(
            zero_rad in uniform2(-0.1_f32..0.1), sine_rad in uniform2(-0.02_f32..0.02), cosine_rad in uniform2(-0.02_f32..0.02),
            second_sine_rad in uniform2(-0.01_f32..0.01), second_cosine_rad in uniform2(-0.01_f32..0.01),
            first in -1.5_f32..1.5, elbow in -3.0_f32..3.0,
        ) {
            let encoders = EncoderCorrection {
                zero_rad, sine_rad, cosine_rad, second_sine_rad, second_cosine_rad,
            };
            let found = encoders.in_pose(&Pose::new(&LinkMotion::new(first, first + elbow)));
            let found = found.to_array();
            for (joint, angle) in [first, elbow].into_iter().enumerate() {
                let twice = 2.0 * angle;
                let expected = zero_rad[joint]
                    + sine_rad[joint] * angle.sin() + cosine_rad[joint] * angle.cos()
                    + second_sine_rad[joint] * twice.sin() + second_cosine_rad[joint] * twice.cos();
                prop_assert!((found[joint] - expected).abs() < 1e-6, "{} {}", found[joint], expected);
            }
            // The loops start near these joints: the harmonics are 0.042 at most, and change by 0.057 of the angle's error.
            let scale = EncoderScale { bits: 24, ..Default::default() };
            let settings = JointEstimatorSettings { encoders, ..Default::default() };
            let mut estimator = JointEstimator::new(&settings, [scale; 2], 1000.0);
            let readings = [first - found[0], elbow - found[1]].map(|it| scale.reading(it.into()));
            let still = JointMotion::zeros();
            let _ = estimator.correct(&readings, 1, &still, &JointTorque::zeros());
            let error = estimator.angles_rad - JointMotion::new(first, elbow);
            prop_assert!(error.amax() < 2.5e-3, "{:?}", error);
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
        let still = JointMotion::zeros();
        for tick in 0..600_u16 {
            let time_s = 1e-3 * f32::from(tick);
            let joints = JointMotion::new(-0.4 + 1.5 * time_s, 0.9 - 2.0 * time_s);
            let truth = joints.to_links();
            let added = encoders.in_pose(&Pose::new(&truth));
            let readings = (joints - added)
                .to_array()
                .map(|angle| scale.reading(f64::from(angle)));
            let _ = estimator.correct(&readings, 1, &still, &JointTorque::zeros());
            let error = (estimator.angles_rad - joints).amax();
            let most = if tick < 100 { 0.02 } else { 6e-4 };
            assert!(error < most, "{tick}: {error}");
            estimator.predict(&still, 1);
            let pose = Pose::new(&estimator.theta_rad());
            estimator.expect_pose(&pose);
        }
    }

    #[test]
    fn no_correction_is_zero() {
        let pose = Pose::new(&LinkMotion::new(0.3, 0.7));
        assert_eq!(
            EncoderCorrection::default().in_pose(&pose),
            JointMotion::zeros()
        );
    }
}

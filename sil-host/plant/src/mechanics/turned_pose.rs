//! Sines and cosines of link angles close to angles whose sines and cosines are known.
//!
//! Within a step of a millisecond the links turn by some milliradians. The addition theorems with
//! short series of the change are then as accurate as new sines and cosines, and cheaper.

use painleve_shared::{LinkMotion, Pose};

/// Largest change for which the series below are exact to rounding, rad: their first omitted terms
/// are d⁹/9! < 1e-19 and d⁸/8! < 3e-17.
const LARGEST_CHANGE_RAD: f64 = 1.0 / 32.0;

/// A pose and its link angles.
#[derive(Clone, Copy, Debug)]
pub struct KnownPose {
    /// Link angles, rad.
    pub angles: LinkMotion<f64>,
    /// Their sines and cosines.
    pub pose: Pose<f64>,
}

impl KnownPose {
    /// Evaluates the pose of link angles, rad.
    #[inline]
    pub fn new(angles: &LinkMotion<f64>) -> Self {
        Self {
            angles: *angles,
            pose: Pose::new(angles),
        }
    }

    /// Returns the pose of link angles (rad) near the known ones.
    #[inline]
    pub fn turned_to(&self, angles: &LinkMotion<f64>) -> Pose<f64> {
        let change = angles.vector() - self.angles.vector();
        // Not `>`: this also sends NaN to the complete evaluation.
        if change.x.abs() <= LARGEST_CHANGE_RAD && change.y.abs() <= LARGEST_CHANGE_RAD {
            let square = change.component_mul(&change);
            let sine = change.component_mul(&series(
                square,
                [1.0, -1.0 / 6.0, 1.0 / 120.0, -1.0 / 5040.0],
            ));
            let cosine = series(square, [1.0, -0.5, 1.0 / 24.0, -1.0 / 720.0]);
            let (known_sine, known_cosine) = (&self.pose.sine, &self.pose.cosine);
            return Pose {
                sine: known_sine.component_mul(&cosine) + known_cosine.component_mul(&sine),
                cosine: known_cosine.component_mul(&cosine) - known_sine.component_mul(&sine),
            };
        }
        Pose::new(angles)
    }
}

/// Returns c₀ + c₁ s + c₂ s² + c₃ s³ of each component s.
#[inline]
fn series(s: nalgebra::Vector2<f64>, c: [f64; 4]) -> nalgebra::Vector2<f64> {
    s.map(|s| (c[0] + c[1] * s) + (c[2] + c[3] * s) * (s * s))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_turned_pose_is_the_pose_of_its_angles(
            t1 in -3.2_f64..3.2, t2 in -3.2_f64..3.2, d1 in -0.04_f64..0.04, d2 in -0.04_f64..0.04,
        ) {
            let known = KnownPose::new(&LinkMotion::new(t1, t2));
            let angles = LinkMotion::new(t1 + d1, t2 + d2);
            let (turned, pose) = (known.turned_to(&angles), Pose::new(&angles));
            prop_assert!((turned.sine - pose.sine).amax() < 4e-16);
            prop_assert!((turned.cosine - pose.cosine).amax() < 4e-16);
        }
    }

    #[test]
    fn an_angle_that_is_not_a_number_gives_no_number() {
        let known = KnownPose::new(&LinkMotion::zeros());
        assert!(
            known
                .turned_to(&LinkMotion::new(f64::NAN, 0.0))
                .sine
                .x
                .is_nan()
        );
    }
}

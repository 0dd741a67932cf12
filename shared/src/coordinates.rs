//! The arm's two sets of coordinates, as distinct types.
//!
//! **Links**: absolute angles θ = (θ1, θ2), in which the equations of motion are written. **Joints**:
//! q' = (θ1, θ2 − θ1), which encoders measure and motors drive. Rates and accelerations
//! convert as the angles do, and torques so that their power is the same in both:
//!
//! ```text
//! q' = (θ1, θ2 − θ1)          u = (u1 − u2, u2)          u · θ̇ = u1 q̇'1 + u2 q̇'2
//! ```
//!
//! Units are in names, as everywhere (`theta_rad`, `theta_dot_rad_s`, `torque_nm`). Values in
//! different coordinates cannot be mixed:
//!
//! ```
//! use painleve_shared::coordinates::{GeneralisedTorque, JointMotion, JointTorque, LinkMotion};
//!
//! let theta_rad = LinkMotion::new(0.3, -0.2);
//! let measured_rad = JointMotion::new(0.3, -0.5);
//! assert_eq!(theta_rad.to_joints(), measured_rad);
//!
//! let torque_nm = JointTorque::new(2.0, 0.5);
//! assert_eq!(torque_nm.to_links(), GeneralisedTorque::new(1.5, 0.5));
//! ```
//!
//! A joint angle is not a link angle:
//!
//! ```compile_fail,E0308
//! # use painleve_shared::coordinates::{JointMotion, LinkMotion};
//! let error = LinkMotion::new(0.3, -0.2) - JointMotion::new(0.3, -0.5);
//! ```
//!
//! A motor torque is not a generalised torque of the equations of motion:
//!
//! ```compile_fail,E0308
//! # use painleve_shared::coordinates::{GeneralisedTorque, JointTorque};
//! let sum = GeneralisedTorque::new(1.5, 0.5) + JointTorque::new(2.0, 0.5);
//! ```
//!
//! Encoder readings must be converted before they give a pose:
//!
//! ```compile_fail,E0308
//! # use painleve_shared::{Pose, coordinates::JointMotion};
//! let pose = Pose::new(&JointMotion::new(0.3, -0.5));
//! ```
//!
//! A damper in the joints takes joint rates:
//!
//! ```compile_fail,E0308
//! # use painleve_shared::coordinates::{JointMotion, JointTorque, LinkMotion};
//! fn damper(rate_rad_s: JointMotion<f64>) -> JointTorque<f64> {
//!     rate_rad_s.torque_by([-0.1; 2])
//! }
//! let torque_nm = damper(LinkMotion::new(1.0, -2.0));
//! ```

use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

use nalgebra::Vector2;

use crate::real::Real;

macro_rules! pair {
    ($(#[$documentation:meta])* $name:ident, $first:ident, $second:ident) => {
        $(#[$documentation])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        #[repr(transparent)]
        pub struct $name<T: Real>(Vector2<T>);

        impl<T: Real> $name<T> {
            /// Makes the pair from both numbers.
            #[inline]
            pub fn new($first: T, $second: T) -> Self {
                Self(Vector2::new($first, $second))
            }

            /// Returns a pair of zeros.
            #[inline]
            pub fn zeros() -> Self {
                Self(Vector2::zeros())
            }

            /// Returns the first number.
            #[inline]
            pub fn first(&self) -> T {
                self.0.x
            }

            /// Returns the second number.
            #[inline]
            pub fn second(&self) -> T {
                self.0.y
            }

            /// Takes a plain vector, the result of matrix algebra, as these coordinates.
            #[inline]
            pub fn from_vector(vector: Vector2<T>) -> Self {
                Self(vector)
            }

            /// Takes a plain array, such as one value for each joint, as these coordinates.
            #[inline]
            pub fn from_array(pair: [T; 2]) -> Self {
                Self(pair.into())
            }

            /// Returns a plain array, for loops over both and for formats without types.
            #[inline]
            pub fn to_array(self) -> [T; 2] {
                self.0.into()
            }

            /// Returns a plain vector, for matrix algebra.
            #[inline]
            pub fn vector(&self) -> &Vector2<T> {
                &self.0
            }

            /// Applies a function to each number.
            #[inline]
            pub fn map(&self, function: impl FnMut(T) -> T) -> Self {
                Self(self.0.map(function))
            }

            /// Returns the larger magnitude of the two.
            #[inline]
            pub fn amax(&self) -> T {
                self.0.amax()
            }
        }

        impl<T: Real> Default for $name<T> {
            fn default() -> Self {
                Self::zeros()
            }
        }

        #[cfg(feature = "defmt")]
        impl<T: Real + defmt::Format> defmt::Format for $name<T> {
            fn format(&self, formatter: defmt::Formatter<'_>) {
                defmt::write!(formatter, "({}, {})", self.first(), self.second());
            }
        }

        impl<T: Real> Add for $name<T> {
            type Output = Self;

            #[inline]
            fn add(self, other: Self) -> Self {
                Self(self.0 + other.0)
            }
        }

        impl<T: Real> AddAssign for $name<T> {
            #[inline]
            fn add_assign(&mut self, other: Self) {
                self.0 += other.0;
            }
        }

        impl<T: Real> Sub for $name<T> {
            type Output = Self;

            #[inline]
            fn sub(self, other: Self) -> Self {
                Self(self.0 - other.0)
            }
        }

        impl<T: Real> Neg for $name<T> {
            type Output = Self;

            #[inline]
            fn neg(self) -> Self {
                Self(-self.0)
            }
        }

        impl<T: Real> Div<T> for $name<T> {
            type Output = Self;

            #[inline]
            fn div(self, divisor: T) -> Self {
                Self(self.0 / divisor)
            }
        }

        impl<T: Real> Mul<T> for $name<T> {
            type Output = Self;

            #[inline]
            fn mul(self, factor: T) -> Self {
                Self(self.0 * factor)
            }
        }
    };
}

pair!(
    /// Absolute angles θ = (θ1, θ2) of both links, measured from the belt's inward normal, or their
    /// rates or accelerations.
    LinkMotion, link_1, link_2);
pair!(
    /// Angles q' = (θ1, θ2 − θ1) of both joints, as encoders measure them, or their rates or
    /// accelerations.
    JointMotion, joint_1, joint_2);
pair!(
    /// Generalised torque u = (u1 − u2, u2) on both links, as in the equations of motion.
    GeneralisedTorque, link_1, link_2);
pair!(
    /// Torques (u1, u2) of both joints' motors.
    JointTorque, joint_1, joint_2);

impl<T: Real> LinkMotion<T> {
    /// Converts to the motion of the joints.
    #[inline]
    pub fn to_joints(self) -> JointMotion<T> {
        JointMotion::new(self.first(), self.second() - self.first())
    }
}

impl<T: Real> JointMotion<T> {
    /// Converts to the motion of the links.
    #[inline]
    pub fn to_links(self) -> LinkMotion<T> {
        LinkMotion::new(self.first(), self.first() + self.second())
    }

    /// Returns the torque of a gain in each joint: stiffness times angle, or damping times rate.
    #[inline]
    pub fn torque_by(&self, gains: [T; 2]) -> JointTorque<T> {
        let [joint_1, joint_2] = gains;
        JointTorque::new(joint_1 * self.first(), joint_2 * self.second())
    }
}

impl<T: Real> JointTorque<T> {
    /// Converts to the generalised torque on the links.
    #[inline]
    pub fn to_links(self) -> GeneralisedTorque<T> {
        GeneralisedTorque::new(self.first() - self.second(), self.second())
    }
}

impl<T: Real> GeneralisedTorque<T> {
    /// Converts to the torques of the joints' motors.
    #[inline]
    pub fn to_joints(self) -> JointTorque<T> {
        JointTorque::new(self.first() + self.second(), self.second())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn both_coordinates_convert_back_and_agree_on_the_power(
            u1 in -5.0_f64..5.0, u2 in -5.0_f64..5.0, w1 in -8.0_f64..8.0, w2 in -8.0_f64..8.0,
        ) {
            let (rates, torques) = (LinkMotion::new(w1, w2), JointTorque::new(u1, u2));
            prop_assert!((rates.to_joints().to_links() - rates).amax() < 1e-14);
            prop_assert!((torques.to_links().to_joints() - torques).amax() < 1e-14);
            let of_links = torques.to_links().vector().dot(rates.vector());
            let of_joints = torques.vector().dot(rates.to_joints().vector());
            prop_assert!((of_links - of_joints).abs() < 1e-12);
        }
    }
}

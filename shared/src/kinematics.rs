//! Kinematics: tip position from joint angles, Jacobian, and joint angles from a tip position.
//!
//! z = (z_t, z_n), with z_t along the belt, z_n upwards and the origin at the first joint.
//! The belt is at z_n = −H. All lengths in m, angles in rad.

use core::cmp::Ordering;

use nalgebra::{Matrix2, Vector2};
use serde::{Deserialize, Serialize};

use crate::arm::Arm;
use crate::coordinates::LinkMotion;
use crate::real::Real;

/// The side to which the elbow bends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Posture {
    /// θ2 − θ1 > 0.
    ElbowUp,
    /// θ2 − θ1 < 0.
    ElbowDown,
}

impl Posture {
    /// Returns the posture of link angles (rad); the straight arm counts as elbow down.
    pub fn of<T: Real>(theta_rad: &LinkMotion<T>) -> Self {
        if theta_rad.second() > theta_rad.first() {
            Posture::ElbowUp
        } else {
            Posture::ElbowDown
        }
    }

    /// Returns the mirror image about the vertical.
    pub fn mirrored(self) -> Self {
        match self {
            Posture::ElbowUp => Posture::ElbowDown,
            Posture::ElbowDown => Posture::ElbowUp,
        }
    }
}

/// Sines and cosines of the link angles, evaluated once and shared by all terms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose<T: Real> {
    /// sin θ1, sin θ2.
    pub sine: Vector2<T>,
    /// cos θ1, cos θ2.
    pub cosine: Vector2<T>,
}

impl<T: Real> Pose<T> {
    /// Evaluates the pose of link angles in rad.
    #[inline]
    pub fn new(theta_rad: &LinkMotion<T>) -> Self {
        let [(sine_1, cosine_1), (sine_2, cosine_2)] =
            T::sines_cosines(theta_rad.first(), theta_rad.second());
        Self {
            sine: Vector2::new(sine_1, sine_2),
            cosine: Vector2::new(cosine_1, cosine_2),
        }
    }

    /// sin(θ2 − θ1): zero for the straight arm.
    #[inline]
    pub fn sine_elbow(&self) -> T {
        self.sine.y * self.cosine.x - self.cosine.y * self.sine.x
    }

    /// cos(θ2 − θ1).
    #[inline]
    pub fn cosine_elbow(&self) -> T {
        self.cosine.y * self.cosine.x + self.sine.y * self.sine.x
    }
}

#[cold]
#[inline(never)]
fn arc_cosine_of<T: Real>(cosine: T) -> T {
    cosine.arc_cosine()
}

impl<T: Real> Arm<T> {
    /// Tip position z = (z_t, z_n), m.
    #[inline]
    pub fn tip_m(&self, pose: &Pose<T>) -> Vector2<T> {
        let (length, ratio) = (self.length_1_m, self.length_ratio);
        Vector2::new(
            length * (pose.sine.x + ratio * pose.sine.y),
            -length * (pose.cosine.x + ratio * pose.cosine.y),
        )
    }

    /// Height of the tip above the belt, z_n + H, m; negative inside the belt.
    #[inline]
    pub fn gap_m(&self, pose: &Pose<T>) -> T {
        self.gap_of_cosines_m(pose.cosine.x, pose.cosine.y)
    }

    /// The same from cos θ1 and cos θ2.
    #[inline]
    pub fn gap_of_cosines_m(&self, cosine_1: T, cosine_2: T) -> T {
        self.height_m - self.length_1_m * (cosine_1 + self.length_ratio * cosine_2)
    }

    /// Jacobian J with ż = J θ̇, m; its rows are the paper's j1 and j2.
    #[inline]
    pub fn jacobian(&self, pose: &Pose<T>) -> Matrix2<T> {
        Matrix2::new(
            self.length_1_m * pose.cosine.x,
            self.length_2_m * pose.cosine.y,
            self.length_1_m * pose.sine.x,
            self.length_2_m * pose.sine.y,
        )
    }

    /// Centripetal acceleration s = J̇ θ̇ of the tip, m/s², for link rates θ̇ (rad/s).
    #[inline]
    pub fn centripetal_m_s2(&self, pose: &Pose<T>, theta_dot_rad_s: &LinkMotion<T>) -> Vector2<T> {
        let length = self.length_1_m;
        let square_1 = theta_dot_rad_s.first() * theta_dot_rad_s.first();
        let square_2 = self.length_ratio * (theta_dot_rad_s.second() * theta_dot_rad_s.second());
        Vector2::new(
            -length * (square_1 * pose.sine.x + square_2 * pose.sine.y),
            length * (square_1 * pose.cosine.x + square_2 * pose.cosine.y),
        )
    }

    /// (l1 − l2)(l1 + l2), m²; zero for equal links.
    #[inline]
    fn difference_of_squares_m2(&self) -> T {
        (self.length_1_m - self.length_2_m) * self.reach_m()
    }

    /// Returns the link angles (θ1, θ2), rad, that put the tip at `tip_m` = (z_t, z_n) in the given
    /// posture; `None` for a point out of reach, for NaN, and for the first joint itself.
    ///
    /// The links lie on either side of the tip's direction φ: θ = φ ∓ β, with
    /// tan φ = −z_t/z_n and, by the law of cosines,
    ///
    /// ```text
    /// cos β1 = (d + (l1² − l2²)/d) / 2 l1,   cos β2 = (d − (l1² − l2²)/d) / 2 l2,   d = |z|
    /// ```
    pub fn link_angles_rad(&self, tip_m: &Vector2<T>, posture: Posture) -> Option<LinkMotion<T>> {
        let distance = (tip_m.x * tip_m.x + tip_m.y * tip_m.y).square_root();
        let two = T::literal(2.0);
        let shift = self.difference_of_squares_m2() / distance;
        // The arc cosine propagates NaN.
        let angle_1 = ((distance + shift) / (self.length_1_m * two)).arc_cosine();
        // Equal links have equal angles.
        let angle_2 = if shift == T::zero() {
            angle_1
        } else {
            arc_cosine_of((distance - shift) / (self.length_2_m * two))
        };
        let sum = angle_1 + angle_2;
        if sum.to_f64().is_nan() {
            return None;
        }
        let direction = tip_m.x.arc_tangent_2(-tip_m.y);
        Some(match posture {
            Posture::ElbowUp => LinkMotion::new(direction - angle_1, direction + angle_2),
            Posture::ElbowDown => LinkMotion::new(direction + angle_1, direction - angle_2),
        })
    }

    /// Returns the link angles, rad, with the tip on the belt at `tip_t_m`; `None` out of reach.
    pub fn link_angles_on_belt_rad(&self, tip_t_m: T, posture: Posture) -> Option<LinkMotion<T>> {
        self.link_angles_rad(&Vector2::new(tip_t_m, -self.height_m), posture)
    }

    /// Returns the link rates θ̇ (rad/s) that move the tip along the belt at `tip_speed_m_s` from
    /// `tip_t_m`; zero where the arm is straight or does not reach.
    ///
    /// They are the time derivative of θ = φ ∓ β in [`link_angles_rad`](Self::link_angles_rad).
    pub fn link_rates_on_belt_rad_s(
        &self,
        tip_t_m: T,
        tip_speed_m_s: T,
        posture: Posture,
    ) -> LinkMotion<T> {
        let height = self.height_m;
        let square = tip_t_m * tip_t_m + height * height;
        let distance = square.square_root();
        let (reach, hole) = (self.reach_m(), self.hole_m());
        // 2 l1 sin β1 = 2 l2 sin β2: both sides give the area of the triangle formed by the links.
        let twice_width =
            ((reach - distance) * (reach + distance) * (T::one() - hole * hole / square))
                .square_root();
        if twice_width.partial_cmp(&T::zero()) != Some(Ordering::Greater) {
            return LinkMotion::zeros();
        }
        let shift = self.difference_of_squares_m2() / square;
        let direction_rate = tip_speed_m_s * height / square;
        let angle_rate = -tip_t_m * tip_speed_m_s / (distance * twice_width);
        let rate_1 = angle_rate * (T::one() - shift);
        let rate_2 = angle_rate * (T::one() + shift);
        match posture {
            Posture::ElbowUp => LinkMotion::new(direction_rate - rate_1, direction_rate + rate_2),
            Posture::ElbowDown => LinkMotion::new(direction_rate + rate_1, direction_rate - rate_2),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm::ArmParameters;
    use proptest::prelude::*;

    fn arm() -> Arm<f64> {
        Arm::new(ArmParameters::default()).unwrap()
    }

    #[test]
    fn the_papers_start_postures_are_mirror_solutions_of_one_tip_position() {
        let down = LinkMotion::new((-11.4_f64).to_radians(), (-35.1_f64).to_radians());
        let up = LinkMotion::new(down.second(), down.first());
        assert_eq!(Posture::of(&down), Posture::ElbowDown);
        assert_eq!(Posture::of(&up), Posture::ElbowUp);
        for theta_rad in [down, up] {
            let tip = arm().tip_m(&Pose::new(&theta_rad));
            assert!((tip.x + 0.1624).abs() < 2e-4, "{tip}");
            assert!((tip.y + 0.3775).abs() < 2e-4, "{tip}");
        }
    }

    #[test]
    fn out_of_reach_and_nan_have_no_link_angles() {
        assert!(
            arm()
                .link_angles_on_belt_rad(0.1842, Posture::ElbowUp)
                .is_none()
        );
        assert!(
            arm()
                .link_angles_on_belt_rad(f64::NAN, Posture::ElbowUp)
                .is_none()
        );
    }

    proptest! {
        #[test]
        fn inverse_kinematics_returns_to_the_tip(
            distance in 0.02_f64..0.4199, direction in -1.5_f64..1.5, up: bool,
        ) {
            let posture = if up { Posture::ElbowUp } else { Posture::ElbowDown };
            let tip = Vector2::new(distance * direction.sin(), -distance * direction.cos());
            let theta_rad = arm().link_angles_rad(&tip, posture).unwrap();
            prop_assert!((arm().tip_m(&Pose::new(&theta_rad)) - tip).norm() < 1e-12);
            prop_assert_eq!(Posture::of(&theta_rad), posture);
        }

        #[test]
        fn link_rates_move_the_tip_along_the_belt(
            tip in -0.18_f64..0.18, speed in -1.0_f64..1.0, up: bool,
        ) {
            let posture = if up { Posture::ElbowUp } else { Posture::ElbowDown };
            let theta_rad = arm().link_angles_on_belt_rad(tip, posture).unwrap();
            let rates = arm().link_rates_on_belt_rad_s(tip, speed, posture);
            let velocity = arm().jacobian(&Pose::new(&theta_rad)) * rates.vector();
            prop_assert!((velocity - Vector2::new(speed, 0.0)).norm() < 1e-9);
        }

        #[test]
        fn jacobian_and_centripetal_term_are_derivatives_of_the_tip(
            t1 in -3.0_f64..3.0, t2 in -3.0_f64..3.0, w1 in -5.0_f64..5.0, w2 in -5.0_f64..5.0,
        ) {
            let (theta_rad, rate, step) = (LinkMotion::new(t1, t2), LinkMotion::new(w1, w2), 1e-4);
            let tip = |s: f64| arm().tip_m(&Pose::new(&(theta_rad + rate * s)));
            let velocity = (tip(step) - tip(-step)) / (2.0 * step);
            let acceleration = (tip(step) - tip(0.0) * 2.0 + tip(-step)) / (step * step);
            let pose = Pose::new(&theta_rad);
            prop_assert!((arm().jacobian(&pose) * rate.vector() - velocity).norm() < 1e-6);
            prop_assert!((arm().centripetal_m_s2(&pose, &rate) - acceleration).norm() < 1e-5);
        }
    }
}

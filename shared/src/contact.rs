//! Contact of the tip with the belt: Q, b, p and the four solution modes (paper, section II-A).
//!
//! In contact z̈_n = b + p f_n. The free normal acceleration b depends on state and torque; p
//! depends only on the posture, the friction coefficient μ and the direction of slip.

use core::cmp::Ordering;

use nalgebra::{Matrix2, Vector2};
use serde::{Deserialize, Serialize};

use crate::arm::Arm;
use crate::coordinates::{GeneralisedTorque, LinkMotion};
use crate::kinematics::{Pose, Posture};
use crate::real::Real;

/// Direction of the tip's velocity relative to the belt, ż_r = ż_t − v_belt.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Slip {
    /// ż_r > 0, the paper's case: friction pulls towards −t.
    #[default]
    Positive,
    /// ż_r < 0, its mirror image.
    Negative,
}

impl Slip {
    /// Returns the direction of a slip velocity; zero counts as positive.
    #[inline]
    pub fn of<T: Real>(slip_velocity_m_s: T) -> Self {
        if slip_velocity_m_s < T::zero() {
            Slip::Negative
        } else {
            Slip::Positive
        }
    }

    /// Returns +1 or −1.
    #[inline]
    pub fn sign<T: Real>(self) -> T {
        match self {
            Slip::Positive => T::one(),
            Slip::Negative => -T::one(),
        }
    }
}

/// The solutions of the sliding equations at one state (paper, section II-A).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SolutionMode {
    /// p > 0, b < 0: the tip slides with f_n = −b/p.
    Sliding,
    /// p > 0, b ≥ 0: the tip leaves the belt.
    Flight,
    /// p ≤ 0, b ≥ 0: both sliding and flight are solutions.
    Indeterminate,
    /// p ≤ 0, b < 0: neither is a solution; only an impact without collision remains.
    Inconsistent,
}

impl SolutionMode {
    /// Returns the mode for these values of p and b.
    ///
    /// The paper's section III requires "b > 0" while sliding. Its own equation for f_n requires b
    /// < 0, in agreement with its section II.
    #[inline]
    pub fn classify<T: Real>(p_per_kg: T, b_m_s2: T) -> Self {
        match (p_per_kg > T::zero(), b_m_s2 < T::zero()) {
            (true, true) => SolutionMode::Sliding,
            (true, false) => SolutionMode::Flight,
            (false, false) => SolutionMode::Indeterminate,
            (false, true) => SolutionMode::Inconsistent,
        }
    }
}

/// Contact-space terms at one state: z̈ = a + Q f.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactTerms<T: Real> {
    /// Q = J M⁻¹ Jᵀ, 1/kg, symmetric.
    pub q: Matrix2<T>,
    /// Tip acceleration without contact force, m/s²; its normal component is b.
    pub free_acceleration_m_s2: Vector2<T>,
}

impl<T: Real> ContactTerms<T> {
    /// Free normal acceleration b, m/s².
    #[inline]
    pub fn b_m_s2(&self) -> T {
        self.free_acceleration_m_s2.y
    }

    /// p = Q22 − μ s Q21, 1/kg, with s the slip direction.
    #[inline]
    pub fn p_per_kg(&self, friction: T, slip: Slip) -> T {
        p_of(&self.q, friction, slip)
    }

    /// Normal force of sliding, f_n = −b/p, N; meaningful in [`SolutionMode::Sliding`].
    #[inline]
    pub fn sliding_normal_force_n(&self, friction: T, slip: Slip) -> T {
        -self.b_m_s2() / self.p_per_kg(friction, slip)
    }

    /// Returns the contact force (f_t, f_n), N, that gives the tip the acceleration
    /// `tip_acceleration_m_s2`; `None` where Q is singular (straight arm).
    #[inline]
    pub fn force_for_acceleration_n(
        &self,
        tip_acceleration_m_s2: &Vector2<T>,
    ) -> Option<Vector2<T>> {
        let determinant = self.q.m11 * self.q.m22 - self.q.m12 * self.q.m21;
        // Not `<=`: this rejects NaN as well.
        if determinant.partial_cmp(&T::zero()) != Some(Ordering::Greater) {
            return None;
        }
        let wanted = tip_acceleration_m_s2 - self.free_acceleration_m_s2;
        Some(Vector2::new(
            (self.q.m22 * wanted.x - self.q.m12 * wanted.y) / determinant,
            (self.q.m11 * wanted.y - self.q.m21 * wanted.x) / determinant,
        ))
    }
}

#[inline]
fn p_of<T: Real>(q: &Matrix2<T>, friction: T, slip: Slip) -> T {
    q.m22 - friction * slip.sign::<T>() * q.m21
}

/// The second row of Q with the tip on the belt, multiplied by a positive factor. The sign of
/// p = Q22 − μ s Q12 does not need the factor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScaledRow<T> {
    /// Q12 (1/kg) times the factor.
    pub q12: T,
    /// Q22 (1/kg) times the factor.
    pub q22: T,
    /// The factor.
    pub factor: T,
}

impl<T: Real> Arm<T> {
    /// Q = J M⁻¹ Jᵀ, 1/kg.
    #[inline]
    pub fn inverse_tip_inertia_per_kg(&self, pose: &Pose<T>) -> Matrix2<T> {
        let jacobian = self.jacobian(pose);
        jacobian * self.inverse_mass_matrix(pose) * jacobian.transpose()
    }

    /// Returns p, 1/kg, of a posture for friction μ and slip direction.
    #[inline]
    pub fn p_per_kg(&self, pose: &Pose<T>, friction: T, slip: Slip) -> T {
        p_of(&self.inverse_tip_inertia_per_kg(pose), friction, slip)
    }

    /// Returns Q12 and Q22 with the tip on the belt at `tip_t_m`. `None` out of reach or for a straight arm.
    ///
    /// On the belt the columns (x1, y1) and (x2, y2) of J follow from z_t without trigonometry.
    /// With d² = z_t² + H², and W four times the area of the triangle formed by the links,
    ///
    /// ```text
    /// W² = ((l1 + l2)² − d²) (d² − (l1 − l2)²),      h1,2 = d² ± (l1² − l2²),
    /// 2d² x1 = H h1 + z_t W,    2d² y1 = z_t h1 − H W,
    /// 2d² x2 = H h2 − z_t W,    2d² y2 = z_t h2 + H W,
    /// 4 l1 l2 cos δ = (d² − (l1 − l2)²) − ((l1 + l2)² − d²),    2 l1 l2 sin δ = W
    /// ```
    pub fn inverse_inertia_row_on_belt(
        &self,
        tip_t_m: T,
        posture: Posture,
    ) -> Option<ScaledRow<T>> {
        let (height, reach) = (self.height_m, self.reach_m());
        let difference = self.length_1_m - self.length_2_m;
        let square = tip_t_m * tip_t_m + height * height;
        let (within, beyond) = (reach * reach - square, square - difference * difference);
        let width_square = within * beyond;
        // Not `<=`: this rejects NaN as well.
        if width_square.partial_cmp(&T::zero()) != Some(Ordering::Greater) {
            return None;
        }
        let root = width_square.square_root();
        let width = match posture {
            Posture::ElbowUp => root,
            Posture::ElbowDown => -root,
        };
        let shift = reach * difference;
        let (along_1, along_2) = (square + shift, square - shift);
        let (x_1, y_1) = (
            height * along_1 + tip_t_m * width,
            tip_t_m * along_1 - height * width,
        );
        let (x_2, y_2) = (
            height * along_2 - tip_t_m * width,
            tip_t_m * along_2 + height * width,
        );
        let coupling = self.quarter_coupled_mass_kg * (beyond - within) - self.rotor_2_kg_m2;
        // M⁻¹ j2, scaled by det M.
        let (row_1, row_2) = (
            self.inertia_2_kg_m2 * y_1 - coupling * y_2,
            self.inertia_1_kg_m2 * y_2 - coupling * y_1,
        );
        let determinant = self.inertia_1_kg_m2 * self.inertia_2_kg_m2 - coupling * coupling;
        let scale = T::literal(4.0) * square * square * determinant;
        Some(ScaledRow {
            q12: x_1 * row_1 + x_2 * row_2,
            q22: y_1 * row_1 + y_2 * row_2,
            factor: scale,
        })
    }

    /// Evaluates all contact terms at link angles `theta_rad`, rates `theta_dot_rad_s` and
    /// generalised torque `torque_nm`.
    #[inline]
    pub fn contact_terms(
        &self,
        theta_rad: &LinkMotion<T>,
        theta_dot_rad_s: &LinkMotion<T>,
        pose: &Pose<T>,
        torque_nm: &GeneralisedTorque<T>,
    ) -> ContactTerms<T> {
        let jacobian = self.jacobian(pose);
        let mobility = self.inverse_mass_matrix(pose);
        let load = *torque_nm
            - self.passive_torque_nm(theta_rad, theta_dot_rad_s, pose)
            - self.centrifugal_torque_nm(theta_dot_rad_s, pose);
        ContactTerms {
            q: jacobian * mobility * jacobian.transpose(),
            free_acceleration_m_s2: jacobian * (mobility * load.vector())
                + self.centripetal_m_s2(pose, theta_dot_rad_s),
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

    fn p_on_belt(tip_t_m: f64, posture: Posture, friction: f64, slip: Slip) -> f64 {
        let theta_rad = arm().link_angles_on_belt_rad(tip_t_m, posture).unwrap();
        arm().p_per_kg(&Pose::new(&theta_rad), friction, slip)
    }

    /// Table II of the paper at μ = 0.6 gives 0.183 elbow up. For elbow down it prints 0.168, which
    /// is the value at μ = 0.5.
    #[test]
    fn p_changes_sign_at_the_admissible_edges() {
        for (edge, margin, posture, friction) in [
            (0.182_68, 1e-5, Posture::ElbowUp, 0.6),
            (0.164_71, 1e-5, Posture::ElbowDown, 0.6),
            (0.168, 1e-3, Posture::ElbowDown, 0.5),
        ] {
            assert!(p_on_belt(edge - margin, posture, friction, Slip::Positive) > 0.0);
            assert!(p_on_belt(edge + margin, posture, friction, Slip::Positive) < 0.0);
        }
    }

    #[test]
    fn the_four_modes_follow_the_signs_of_p_and_b() {
        assert_eq!(SolutionMode::classify(1.0, -1.0), SolutionMode::Sliding);
        assert_eq!(SolutionMode::classify(1.0, 1.0), SolutionMode::Flight);
        assert_eq!(
            SolutionMode::classify(-1.0, 1.0),
            SolutionMode::Indeterminate
        );
        assert_eq!(
            SolutionMode::classify(-1.0, -1.0),
            SolutionMode::Inconsistent
        );
    }

    proptest! {
        #[test]
        fn p_is_the_same_for_the_mirrored_posture_and_slip(
            tip in -0.18_f64..0.18, friction in 0.0_f64..1.5, up: bool,
        ) {
            let posture = if up { Posture::ElbowUp } else { Posture::ElbowDown };
            let here = p_on_belt(tip, posture, friction, Slip::Positive);
            let there = p_on_belt(-tip, posture.mirrored(), friction, Slip::Negative);
            prop_assert!((here - there).abs() < 1e-9);
        }

        #[test]
        fn the_row_on_the_belt_is_that_of_the_matrix_q(tip in -0.184_f64..0.184, up: bool) {
            let posture = if up { Posture::ElbowUp } else { Posture::ElbowDown };
            let theta_rad = arm().link_angles_on_belt_rad(tip, posture).unwrap();
            let q = arm().inverse_tip_inertia_per_kg(&Pose::new(&theta_rad));
            let row = arm().inverse_inertia_row_on_belt(tip, posture).unwrap();
            prop_assert!((row.q22 / row.factor - q.m22).abs() < 1e-9 * q.m22);
            prop_assert!(row.q22 > 0.0);
            prop_assert!((row.q12 / row.q22 - q.m12 / q.m22).abs() < 1e-9);
        }

        #[test]
        fn the_force_for_an_acceleration_gives_it(
            tip in -0.17_f64..0.17, w1 in -3.0_f64..3.0, w2 in -3.0_f64..3.0,
            a_t in -20.0_f64..20.0, a_n in -20.0_f64..20.0,
        ) {
            let theta_rad = arm().link_angles_on_belt_rad(tip, Posture::ElbowDown).unwrap();
            let terms = arm().contact_terms(
                &theta_rad, &LinkMotion::new(w1, w2), &Pose::new(&theta_rad), &GeneralisedTorque::zeros());
            let wanted = Vector2::new(a_t, a_n);
            let force = terms.force_for_acceleration_n(&wanted).unwrap();
            prop_assert!((terms.free_acceleration_m_s2 + terms.q * force - wanted).norm() < 1e-9);
        }
    }
}

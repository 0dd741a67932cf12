//! Equations of motion: M θ̈ = −w − c + Jᵀ f + u (paper, eq. 1).

use nalgebra::{Matrix2, Vector2};

use crate::arm::Arm;
use crate::kinematics::Pose;
use crate::real::Real;

/// Generalised torque u = (u1 − u2, u2) of joint torques (u1, u2), N·m.
#[inline]
pub fn generalised_torque_nm<T: Real>(joint_torque_nm: &Vector2<T>) -> Vector2<T> {
    Vector2::new(joint_torque_nm.x - joint_torque_nm.y, joint_torque_nm.y)
}

/// Joint torques (u1, u2) of a generalised torque u, N·m; inverse of
/// [`generalised_torque_nm`].
#[inline]
pub fn joint_torque_nm<T: Real>(generalised_nm: &Vector2<T>) -> Vector2<T> {
    Vector2::new(generalised_nm.x + generalised_nm.y, generalised_nm.y)
}

impl<T: Real> Arm<T> {
    /// Mass matrix M, kg·m², symmetric and positive definite.
    #[inline]
    pub fn mass_matrix(&self, pose: &Pose<T>) -> Matrix2<T> {
        let coupling = self.coupled_inertia(pose);
        Matrix2::new(self.inertia_1, coupling, coupling, self.inertia_2)
    }

    /// Inverse M⁻¹, 1/(kg·m²). [`Arm::new`] has made sure that it exists in every posture.
    #[inline]
    pub fn inverse_mass_matrix(&self, pose: &Pose<T>) -> Matrix2<T> {
        let coupling = self.coupled_inertia(pose);
        let scale = T::one() / (self.inertia_1 * self.inertia_2 - coupling * coupling);
        let off_diagonal = -coupling * scale;
        Matrix2::new(
            self.inertia_2 * scale,
            off_diagonal,
            off_diagonal,
            self.inertia_1 * scale,
        )
    }

    /// M12, kg·m². The second rotor turns with θ2 − θ1.
    #[inline]
    fn coupled_inertia(&self, pose: &Pose<T>) -> T {
        self.inertia_coupling * pose.cosine_elbow() - self.rotor_2
    }

    /// Torque w of gravity, springs and dashpots, N·m, at link angles `theta`
    /// (rad) and rates `theta_dot` (rad/s).
    #[inline]
    pub fn passive_torque_nm(
        &self,
        theta: &Vector2<T>,
        theta_dot: &Vector2<T>,
        pose: &Pose<T>,
    ) -> Vector2<T> {
        let gravity_1 =
            self.gravity_1_normal * pose.sine.x + self.gravity_1_tangential * pose.cosine.x;
        let gravity_2 =
            self.gravity_2_normal * pose.sine.y + self.gravity_2_tangential * pose.cosine.y;
        let spring_1 = self.stiffness_1 * (theta.x - self.spring_rest_1);
        let spring_2 = self.stiffness_2 * (theta.y - theta.x - self.spring_rest_2);
        let elbow_rate = theta_dot.y - theta_dot.x;
        // σ1 θ̇1 − σ2 (θ̇2 − θ̇1); the first term is zero for equal dashpots.
        let damping_1 =
            self.damping_1_excess * theta_dot.x - self.damping_2 * (elbow_rate - theta_dot.x);
        Vector2::new(
            gravity_1 - spring_2 + damping_1 + spring_1,
            gravity_2 + spring_2 + self.damping_2 * elbow_rate,
        )
    }

    /// Centrifugal torque c, N·m.
    #[inline]
    pub fn centrifugal_torque_nm(&self, theta_dot: &Vector2<T>, pose: &Pose<T>) -> Vector2<T> {
        let coupling = self.inertia_coupling * pose.sine_elbow();
        Vector2::new(
            -coupling * theta_dot.y * theta_dot.y,
            coupling * theta_dot.x * theta_dot.x,
        )
    }

    /// Kinetic plus potential energy, J; the potential is zero for springs at rest and centres of
    /// mass as high as the first joint.
    pub fn energy_j(&self, theta: &Vector2<T>, theta_dot: &Vector2<T>) -> T {
        let pose = Pose::new(theta);
        let half = T::literal(0.5);
        let kinetic = theta_dot.dot(&(self.mass_matrix(&pose) * theta_dot)) * half;
        let gravity = self.gravity_1_tangential * pose.sine.x
            + self.gravity_2_tangential * pose.sine.y
            - (self.gravity_1_normal * pose.cosine.x + self.gravity_2_normal * pose.cosine.y);
        let (stretch_1, stretch_2) = (
            theta.x - self.spring_rest_1,
            theta.y - theta.x - self.spring_rest_2,
        );
        let springs =
            self.stiffness_1 * stretch_1 * stretch_1 + self.stiffness_2 * stretch_2 * stretch_2;
        kinetic + gravity + springs * half
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm::ArmParameters;
    use proptest::prelude::*;

    prop_compose! {
        fn state()(t1 in -3.0_f64..3.0, t2 in -3.0_f64..3.0, w1 in -8.0_f64..8.0, w2 in -8.0_f64..8.0)
            -> (Vector2<f64>, Vector2<f64>) {
            (Vector2::new(t1, t2), Vector2::new(w1, w2))
        }
    }

    fn acceleration(
        arm: &Arm<f64>,
        theta: &Vector2<f64>,
        theta_dot: &Vector2<f64>,
    ) -> Vector2<f64> {
        let pose = Pose::new(theta);
        -arm.inverse_mass_matrix(&pose)
            * (arm.passive_torque_nm(theta, theta_dot, &pose)
                + arm.centrifugal_torque_nm(theta_dot, &pose))
    }

    proptest! {
        #[test]
        fn inverse_mass_matrix_is_the_inverse((theta, _) in state()) {
            let arm = Arm::<f64>::new(ArmParameters::default()).unwrap();
            let pose = Pose::new(&theta);
            let product = arm.mass_matrix(&pose) * arm.inverse_mass_matrix(&pose);
            prop_assert!((product - Matrix2::identity()).norm() < 1e-12);
        }

        #[test]
        fn free_motion_changes_energy_only_by_damping((theta, theta_dot) in state()) {
            let arm = Arm::<f64>::new(ArmParameters::default()).unwrap();
            let step = 1e-6;
            let theta_ddot = acceleration(&arm, &theta, &theta_dot);
            let energy = |s: f64| arm.energy_j(
                &(theta + theta_dot * s + theta_ddot * (0.5 * s * s)),
                &(theta_dot + theta_ddot * s),
            );
            let power = (energy(step) - energy(-step)) / (2.0 * step);
            let elbow = theta_dot.y - theta_dot.x;
            let dissipated = 0.005 * (theta_dot.x * theta_dot.x + elbow * elbow);
            prop_assert!((power + dissipated).abs() < 1e-5 * (1.0 + power.abs()), "{power} {dissipated}");
        }

        #[test]
        fn the_arm_without_spring_rest_angle_is_symmetric_about_the_vertical((theta, theta_dot) in state()) {
            let arm = Arm::<f64>::new(ArmParameters { spring_rest_rad: [0.0; 2], ..Default::default() }).unwrap();
            let mirrored = acceleration(&arm, &-theta, &-theta_dot);
            prop_assert!((acceleration(&arm, &theta, &theta_dot) + mirrored).norm() < 1e-9);
        }

        #[test]
        fn joint_and_generalised_torque_round_trip(u1 in -5.0_f64..5.0, u2 in -5.0_f64..5.0) {
            let joint = Vector2::new(u1, u2);
            prop_assert!((joint_torque_nm(&generalised_torque_nm(&joint)) - joint).norm() < 1e-14);
        }
    }
}

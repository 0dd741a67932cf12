//! Equations of motion: M θ̈ = −w − c + Jᵀ f + u (paper, eq. 1).

use nalgebra::Matrix2;

use crate::arm::Arm;
use crate::coordinates::{GeneralisedTorque, LinkMotion};
use crate::kinematics::Pose;
use crate::real::Real;

impl<T: Real> Arm<T> {
    /// Mass matrix M, kg·m², symmetric and positive definite.
    #[inline]
    pub fn mass_matrix(&self, pose: &Pose<T>) -> Matrix2<T> {
        let coupling = self.coupled_inertia_kg_m2(pose);
        Matrix2::new(
            self.inertia_1_kg_m2,
            coupling,
            coupling,
            self.inertia_2_kg_m2,
        )
    }

    /// Returns the inverse M⁻¹, 1/(kg·m²). [`Arm::new`] has checked that it exists in every
    /// posture.
    #[inline]
    pub fn inverse_mass_matrix(&self, pose: &Pose<T>) -> Matrix2<T> {
        let coupling = self.coupled_inertia_kg_m2(pose);
        let scale = T::one() / (self.inertia_1_kg_m2 * self.inertia_2_kg_m2 - coupling * coupling);
        let off_diagonal = -coupling * scale;
        Matrix2::new(
            self.inertia_2_kg_m2 * scale,
            off_diagonal,
            off_diagonal,
            self.inertia_1_kg_m2 * scale,
        )
    }

    /// M12, kg·m². The second rotor turns with θ2 − θ1.
    #[inline]
    fn coupled_inertia_kg_m2(&self, pose: &Pose<T>) -> T {
        self.inertia_coupling_kg_m2 * pose.cosine_elbow() - self.rotor_2_kg_m2
    }

    /// Returns the torque w of gravity, springs and dashpots, N·m, at link angles `theta_rad` and
    /// rates `theta_dot_rad_s`.
    #[inline]
    pub fn passive_torque_nm(
        &self,
        theta_rad: &LinkMotion<T>,
        theta_dot_rad_s: &LinkMotion<T>,
        pose: &Pose<T>,
    ) -> GeneralisedTorque<T> {
        let joints = theta_rad.to_joints();
        let damping = self.damping_torque_nm(theta_dot_rad_s);
        let gravity_1 =
            self.gravity_1_normal_nm * pose.sine.x + self.gravity_1_tangential_nm * pose.cosine.x;
        let gravity_2 =
            self.gravity_2_normal_nm * pose.sine.y + self.gravity_2_tangential_nm * pose.cosine.y;
        let spring_1 = self.stiffness_1_nm_rad * (joints.first() - self.spring_rest_1_rad);
        let spring_2 = self.stiffness_2_nm_rad * (joints.second() - self.spring_rest_2_rad);
        GeneralisedTorque::new(
            gravity_1 - spring_2 + damping.first() + spring_1,
            gravity_2 + spring_2 + damping.second(),
        )
    }

    /// Returns the change ∂w/∂θ of the torque w, N·m/rad, by gravity and springs.
    #[inline]
    pub fn passive_stiffness_nm_rad(&self, pose: &Pose<T>) -> Matrix2<T> {
        let gravity_1 =
            self.gravity_1_normal_nm * pose.cosine.x - self.gravity_1_tangential_nm * pose.sine.x;
        let gravity_2 =
            self.gravity_2_normal_nm * pose.cosine.y - self.gravity_2_tangential_nm * pose.sine.y;
        let elbow = self.stiffness_2_nm_rad;
        Matrix2::new(
            gravity_1 + self.stiffness_1_nm_rad + elbow,
            -elbow,
            -elbow,
            gravity_2 + elbow,
        )
    }

    /// Returns the part of w by the dashpots, N·m, at link rates `theta_dot_rad_s`.
    #[inline]
    pub fn damping_torque_nm(&self, theta_dot_rad_s: &LinkMotion<T>) -> GeneralisedTorque<T> {
        let joint_rates = theta_dot_rad_s.to_joints();
        let (rate_1, elbow_rate) = (joint_rates.first(), joint_rates.second());
        // σ1 θ̇1 − σ2 (θ̇2 − θ̇1); the first term is zero for equal dashpots.
        GeneralisedTorque::new(
            self.damping_1_excess_nms_rad * rate_1 - self.damping_2_nms_rad * (elbow_rate - rate_1),
            self.damping_2_nms_rad * elbow_rate,
        )
    }

    /// Centrifugal torque on link 2 for each rad²/s² of link 1, N·m·s²; link 2 acts on link 1 with the opposite sign.
    #[inline]
    pub fn centrifugal_nms2(&self, pose: &Pose<T>) -> T {
        self.inertia_coupling_kg_m2 * pose.sine_elbow()
    }

    /// Centrifugal torque c, N·m.
    #[inline]
    pub fn centrifugal_torque_nm(
        &self,
        theta_dot_rad_s: &LinkMotion<T>,
        pose: &Pose<T>,
    ) -> GeneralisedTorque<T> {
        let coupling = self.centrifugal_nms2(pose);
        let (rate_1, rate_2) = (theta_dot_rad_s.first(), theta_dot_rad_s.second());
        GeneralisedTorque::new(-coupling * rate_2 * rate_2, coupling * rate_1 * rate_1)
    }

    /// Returns kinetic plus potential energy, J. The potential energy is zero with relaxed springs
    /// and the centres of mass level with the first joint.
    pub fn energy_j(&self, theta_rad: &LinkMotion<T>, theta_dot_rad_s: &LinkMotion<T>) -> T {
        let pose = Pose::new(theta_rad);
        let half = T::literal(0.5);
        let rates = theta_dot_rad_s.vector();
        let kinetic = rates.dot(&(self.mass_matrix(&pose) * rates)) * half;
        let gravity = self.gravity_1_tangential_nm * pose.sine.x
            + self.gravity_2_tangential_nm * pose.sine.y
            - (self.gravity_1_normal_nm * pose.cosine.x + self.gravity_2_normal_nm * pose.cosine.y);
        let joints = theta_rad.to_joints();
        let (stretch_1, stretch_2) = (
            joints.first() - self.spring_rest_1_rad,
            joints.second() - self.spring_rest_2_rad,
        );
        let springs = self.stiffness_1_nm_rad * stretch_1 * stretch_1
            + self.stiffness_2_nm_rad * stretch_2 * stretch_2;
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
            -> (LinkMotion<f64>, LinkMotion<f64>) {
            (LinkMotion::new(t1, t2), LinkMotion::new(w1, w2))
        }
    }

    fn acceleration(
        arm: &Arm<f64>,
        theta_rad: &LinkMotion<f64>,
        theta_dot_rad_s: &LinkMotion<f64>,
    ) -> LinkMotion<f64> {
        let pose = Pose::new(theta_rad);
        let load_nm = arm.passive_torque_nm(theta_rad, theta_dot_rad_s, &pose)
            + arm.centrifugal_torque_nm(theta_dot_rad_s, &pose);
        LinkMotion::from_vector(-arm.inverse_mass_matrix(&pose) * load_nm.vector())
    }

    proptest! {
        #[test]
        fn the_passive_stiffness_is_the_derivative_of_the_torque((theta_rad, theta_dot_rad_s) in state(), d1 in -1.0_f64..1.0, d2 in -1.0_f64..1.0) {
            let arm = Arm::<f64>::new(ArmParameters { stiffness_nm_rad: [0.4, 1.3], belt_tilt_rad: 0.1, ..Default::default() }).unwrap();
            let torque = |step: f64| {
                let theta_rad = theta_rad + LinkMotion::new(d1, d2) * step;
                *arm.passive_torque_nm(&theta_rad, &theta_dot_rad_s, &Pose::new(&theta_rad)).vector()
            };
            let slope = (torque(1e-5) - torque(-1e-5)) / 2e-5;
            let expected = arm.passive_stiffness_nm_rad(&Pose::new(&theta_rad)) * nalgebra::Vector2::new(d1, d2);
            prop_assert!((slope - expected).amax() < 1e-8);
        }

        #[test]
        fn inverse_mass_matrix_is_the_inverse((theta_rad, _) in state()) {
            let arm = Arm::<f64>::new(ArmParameters::default()).unwrap();
            let pose = Pose::new(&theta_rad);
            let product = arm.mass_matrix(&pose) * arm.inverse_mass_matrix(&pose);
            prop_assert!((product - Matrix2::identity()).norm() < 1e-12);
        }

        #[test]
        fn free_motion_changes_energy_only_by_damping((theta_rad, theta_dot_rad_s) in state()) {
            let arm = Arm::<f64>::new(ArmParameters::default()).unwrap();
            let step = 1e-6;
            let theta_ddot = acceleration(&arm, &theta_rad, &theta_dot_rad_s);
            let energy = |s: f64| arm.energy_j(
                &(theta_rad + theta_dot_rad_s * s + theta_ddot * (0.5 * s * s)),
                &(theta_dot_rad_s + theta_ddot * s),
            );
            let power = (energy(step) - energy(-step)) / (2.0 * step);
            let dissipated = 0.005 * theta_dot_rad_s.to_joints().vector().norm_squared();
            prop_assert!((power + dissipated).abs() < 1e-5 * (1.0 + power.abs()), "{power} {dissipated}");
        }

        #[test]
        fn the_arm_without_spring_rest_angle_is_symmetric_about_the_vertical((theta_rad, theta_dot_rad_s) in state()) {
            let arm = Arm::<f64>::new(ArmParameters { spring_rest_rad: [0.0; 2], ..Default::default() }).unwrap();
            let mirrored = acceleration(&arm, &-theta_rad, &-theta_dot_rad_s);
            prop_assert!((acceleration(&arm, &theta_rad, &theta_dot_rad_s) + mirrored).amax() < 1e-9);
        }
    }
}

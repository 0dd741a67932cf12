//! The arm's model, shared by law and recovery. It is evaluated once for each tick, at the state
//! that is predicted for it, before its readings arrive.

use nalgebra::{Matrix2, Vector2};
use painleve_shared::{Arm, GeneralisedTorque, JointTorque, LinkMotion, Pose, Real};

use super::friction::FrictionEstimate;

/// |sin(θ2 − θ1)| below which J⁻¹ is bounded: the arm is nearly straight, and no torque can move
/// the tip along the belt.
const STRAIGHT_ARM_SINE: f32 = 0.05;

/// Terms of the equations of motion at one state; all zero before the first evaluation.
#[derive(Clone, Copy, Debug, Default)]
pub struct Model {
    /// Link angles θ, rad.
    pub theta_rad: LinkMotion<f32>,
    /// Link rates θ̇, rad/s.
    pub theta_dot_rad_s: LinkMotion<f32>,
    /// Tip (z_t, z_n), m.
    pub tip_m: Vector2<f32>,
    /// Height of the tip above the belt, m.
    pub gap_m: f32,
    /// Velocity of the tip, m/s.
    pub tip_velocity_m_s: Vector2<f32>,
    /// J, m.
    pub jacobian: Matrix2<f32>,
    /// M, kg·m².
    mass: Matrix2<f32>,
    /// M⁻¹, 1/(kg·m²).
    mobility: Matrix2<f32>,
    /// ∂w/∂θ, N·m/rad.
    stiffness_nm_rad: Matrix2<f32>,
    /// w + c − d with the friction of the joints, N·m.
    pub(crate) bias_nm: GeneralisedTorque<f32>,
    /// Centrifugal torque on link 2 for each rad²/s² of link 1, and on link 1 against that of link 2, N·m·s².
    centrifugal_nms2: f32,
    /// Centripetal acceleration s of the tip, m/s².
    centripetal_m_s2: Vector2<f32>,
    /// 1 / det J, with the determinant bounded away from zero, 1/m².
    inverse_determinant_per_m2: f32,
    /// Change of the free normal acceleration b with the joint torques (u1, u2), 1/(kg·m).
    pub free_slope_per_kg_m: Vector2<f32>,
    /// Q11 of Q = J M⁻¹ Jᵀ, 1/kg.
    pub q11_per_kg: f32,
    /// Q12, 1/kg.
    pub q12_per_kg: f32,
    /// Q22, 1/kg.
    pub q22_per_kg: f32,
}

impl Model {
    /// Evaluates the terms at link angles θ (rad), whose pose is given, and rates θ̇ (rad/s), with an additional
    /// generalised torque d (N·m) on the arm.
    #[inline]
    pub fn in_pose(
        arm: &Arm<f32>,
        pose: &Pose<f32>,
        theta_rad: LinkMotion<f32>,
        theta_dot_rad_s: LinkMotion<f32>,
        disturbance_nm: &GeneralisedTorque<f32>,
    ) -> Self {
        let jacobian = arm.jacobian(pose);
        let mobility = arm.inverse_mass_matrix(pose);
        let sine_elbow = pose.sine_elbow();
        let bounded = sine_elbow
            .abs()
            .at_least(STRAIGHT_ARM_SINE)
            .copysign(sine_elbow);
        let [length_1, length_2] = arm.link_length_m();
        // Accelerations of the links by each component of the contact force.
        let response = mobility * jacobian.transpose();
        let q = jacobian * response;
        let tip_m = arm.tip_m(pose);
        let bias_nm = arm.passive_torque_nm(&theta_rad, &theta_dot_rad_s, pose)
            + arm.centrifugal_torque_nm(&theta_dot_rad_s, pose)
            - *disturbance_nm;
        let centripetal_m_s2 = arm.centripetal_m_s2(pose, &theta_dot_rad_s);
        Self {
            theta_rad,
            theta_dot_rad_s,
            tip_m,
            gap_m: arm.height_m() + tip_m.y,
            tip_velocity_m_s: jacobian * theta_dot_rad_s.vector(),
            jacobian,
            mass: arm.mass_matrix(pose),
            mobility,
            stiffness_nm_rad: arm.passive_stiffness_nm_rad(pose),
            bias_nm,
            centrifugal_nms2: arm.centrifugal_nms2(pose),
            centripetal_m_s2,
            // det J = l1 l2 sin(θ2 − θ1).
            inverse_determinant_per_m2: 1.0 / (length_1 * length_2 * bounded),
            free_slope_per_kg_m: Vector2::new(response.m12, response.m22 - response.m12),
            q11_per_kg: q.m11,
            q12_per_kg: q.m21,
            q22_per_kg: q.m22,
        }
    }

    /// Moves the model to these link angles θ (rad) and rates θ̇ (rad/s) nearby, to first order: the tip, and everything that
    /// the inverse dynamics need. M⁻¹, Q, det J and the slope of the free normal acceleration stay those of the predicted
    /// state, from which the readings are a count or so away.
    #[inline]
    pub fn move_to(
        &mut self,
        arm: &Arm<f32>,
        theta_rad: LinkMotion<f32>,
        theta_dot_rad_s: LinkMotion<f32>,
    ) {
        let turned = theta_rad - self.theta_rad;
        // Each column of J turns with its link.
        let j = &self.jacobian;
        let across_1 = Vector2::new(-j.m21, j.m11) * turned.first();
        let across_2 = Vector2::new(-j.m22, j.m12) * turned.second();
        // The tip moves by J δθ: at right angles to the same changes.
        let moved = across_1 + across_2;
        self.tip_m += Vector2::new(moved.y, -moved.x);
        self.gap_m -= moved.x;
        self.jacobian += Matrix2::from_columns(&[across_1, across_2]);
        self.tip_velocity_m_s = self.jacobian * theta_dot_rad_s.vector();

        let squares = |rates: &LinkMotion<f32>| rates.vector().component_mul(rates.vector());
        let now = squares(&theta_dot_rad_s);
        let change = now - squares(&self.theta_dot_rad_s);
        // Each link's part is at right angles to its column of J.
        let across = self.jacobian * now;
        self.centripetal_m_s2 = Vector2::new(-across.y, across.x);
        self.bias_nm += arm.damping_torque_nm(&(theta_dot_rad_s - self.theta_dot_rad_s))
            + GeneralisedTorque::new(
                -self.centrifugal_nms2 * change.y,
                self.centrifugal_nms2 * change.x,
            );
        // ∂M12/∂(θ2 − θ1) is the coefficient of the centrifugal torques with the opposite sign.
        let coupling = self.mass.m12 - self.centrifugal_nms2 * (turned.second() - turned.first());
        self.mass.m12 = coupling;
        self.mass.m21 = coupling;
        self.bias_nm += GeneralisedTorque::from_vector(self.stiffness_nm_rad * turned.vector());
        self.theta_rad = theta_rad;
        self.theta_dot_rad_s = theta_dot_rad_s;
    }

    /// Returns the link acceleration θ̈ = J⁻¹ (z̈ − s), rad/s², for a tip acceleration z̈ (m/s²).
    pub fn link_acceleration_rad_s2(
        &self,
        tip_acceleration_m_s2: &Vector2<f32>,
    ) -> LinkMotion<f32> {
        let wanted = tip_acceleration_m_s2 - self.centripetal_m_s2;
        let j = &self.jacobian;
        LinkMotion::new(
            (j.m22 * wanted.x - j.m12 * wanted.y) * self.inverse_determinant_per_m2,
            (j.m11 * wanted.y - j.m21 * wanted.x) * self.inverse_determinant_per_m2,
        )
    }

    /// Returns the joint torques, N·m, for a link acceleration θ̈ (rad/s²) under a contact force
    /// (f_t, f_n), N: inverse dynamics u = w + c + M θ̈ − Jᵀ f.
    pub fn inverse_dynamics_nm(
        &self,
        acceleration_rad_s2: &LinkMotion<f32>,
        force_n: &Vector2<f32>,
    ) -> JointTorque<f32> {
        (self.bias_nm + self.motion_torque_nm(acceleration_rad_s2) - self.force_torque_nm(force_n))
            .to_joints()
    }

    /// Returns the joint torques, N·m, for a link acceleration without contact: u = w + c + M θ̈.
    pub fn inverse_dynamics_in_air_nm(
        &self,
        acceleration_rad_s2: &LinkMotion<f32>,
    ) -> JointTorque<f32> {
        (self.bias_nm + self.motion_torque_nm(acceleration_rad_s2)).to_joints()
    }

    /// Returns the joint torques, N·m, that balance a contact force (f_t, f_n), N: −Jᵀ f.
    pub fn torque_against_nm(&self, force_n: &Vector2<f32>) -> JointTorque<f32> {
        (-self.force_torque_nm(force_n)).to_joints()
    }

    /// M θ̈, N·m.
    fn motion_torque_nm(&self, acceleration_rad_s2: &LinkMotion<f32>) -> GeneralisedTorque<f32> {
        GeneralisedTorque::from_vector(self.mass * acceleration_rad_s2.vector())
    }

    /// Jᵀ f, N·m.
    fn force_torque_nm(&self, force_n: &Vector2<f32>) -> GeneralisedTorque<f32> {
        GeneralisedTorque::from_vector(self.jacobian.transpose() * force_n)
    }

    /// M⁻¹ u, rad/s².
    fn acceleration_by(&self, torque_nm: GeneralisedTorque<f32>) -> LinkMotion<f32> {
        LinkMotion::from_vector(self.mobility * torque_nm.vector())
    }

    /// Returns the link acceleration θ̈ (rad/s²) of an arm without contact under joint torques,
    /// N·m: M⁻¹ (u − w − c).
    #[inline]
    pub fn free_acceleration_rad_s2(&self, torque_nm: &JointTorque<f32>) -> LinkMotion<f32> {
        self.acceleration_by(torque_nm.to_links() - self.bias_nm)
    }

    /// Returns the link acceleration θ̈ (rad/s²) due to a contact force (f_t, f_n), N: M⁻¹ Jᵀ f.
    #[inline]
    pub fn contact_acceleration_rad_s2(&self, force_n: &Vector2<f32>) -> LinkMotion<f32> {
        self.acceleration_by(self.force_torque_nm(force_n))
    }

    /// p = Q22 − μ s Q12, 1/kg.
    pub fn p_per_kg(&self, friction: &FrictionEstimate) -> f32 {
        self.q22_per_kg - friction.coefficient * friction.slip.sign::<f32>() * self.q12_per_kg
    }
}

#[cfg(test)]
impl Model {
    /// Evaluates the terms without the pose.
    pub fn new(
        arm: &Arm<f32>,
        theta_rad: LinkMotion<f32>,
        theta_dot_rad_s: LinkMotion<f32>,
        disturbance_nm: &GeneralisedTorque<f32>,
    ) -> Self {
        let pose = Pose::new(&theta_rad);
        Self::in_pose(arm, &pose, theta_rad, theta_dot_rad_s, disturbance_nm)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use painleve_shared::{ArmParameters, Posture};
    use proptest::prelude::*;

    prop_compose! {
        fn model()(tip in -0.16_f32..0.16, w1 in -3.0_f32..3.0, w2 in -3.0_f32..3.0, up: bool)
            -> (Arm<f32>, Model) {
            let arm = Arm::new(ArmParameters::default()).unwrap();
            let posture = if up { Posture::ElbowUp } else { Posture::ElbowDown };
            let theta = arm.link_angles_on_belt_rad(tip, posture).unwrap();
            (arm, Model::new(&arm, theta, LinkMotion::new(w1, w2), &GeneralisedTorque::zeros()))
        }
    }

    #[test]
    fn an_arm_that_is_nearly_straight_is_asked_for_less() {
        let arm = Arm::new(ArmParameters::default()).unwrap();
        for (sine, share) in [
            (0.2, 1.0),
            (0.05, 1.0),
            (0.04, 0.8),
            (0.01, 0.2),
            (-0.01, 0.2),
        ] {
            let elbow_rad = libm::asinf(sine);
            let theta = LinkMotion::new(0.3, 0.3 + elbow_rad);
            let still = LinkMotion::zeros();
            let model = Model::new(&arm, theta, still, &GeneralisedTorque::zeros());
            let wanted = Vector2::new(2.0, -1.0);
            let links = model.link_acceleration_rad_s2(&wanted);
            let found = model.jacobian * links.vector();
            assert!((found - wanted * share).norm() < 2e-3, "{sine}: {found}");
        }
    }

    proptest! {
        #[test]
        fn forward_dynamics_undo_inverse_dynamics(
            (_, model) in model(), a1 in -50.0_f32..50.0, a2 in -50.0_f32..50.0, f_n in 0.0_f32..10.0,
        ) {
            let acceleration = LinkMotion::new(a1, a2);
            let force = Vector2::new(-0.6 * f_n, f_n);
            let torque = model.inverse_dynamics_nm(&acceleration, &force);
            let found =
                model.free_acceleration_rad_s2(&torque) + model.contact_acceleration_rad_s2(&force);
            prop_assert!((found - acceleration).amax() < 0.02, "{:?} {:?}", found, acceleration);
        }

        #[test]
        fn link_accelerations_give_the_tip_acceleration(
            (_, model) in model(), a_t in -20.0_f32..20.0, a_n in -20.0_f32..20.0,
        ) {
            let wanted = Vector2::new(a_t, a_n);
            let links = model.link_acceleration_rad_s2(&wanted);
            let found = model.jacobian * links.vector() + model.centripetal_m_s2;
            prop_assert!((found - wanted).norm() < 1e-3, "{} {}", found, wanted);
        }

        #[test]
        fn a_tip_moved_by_an_encoders_count_is_where_the_model_puts_it(
            (arm, mut model) in model(), d1 in -1e-3_f32..1e-3, d2 in -1e-3_f32..1e-3,
        ) {
            let theta = model.theta_rad + LinkMotion::new(d1, d2);
            let theta_dot = LinkMotion::new(1.0, -2.0);
            let there = Model::new(&arm, theta, theta_dot, &GeneralisedTorque::zeros());
            model.move_to(&arm, theta, theta_dot);
            prop_assert!((model.tip_m - there.tip_m).amax() < 1e-6);
            prop_assert!((model.gap_m - there.gap_m).abs() < 1e-6);
            prop_assert!((model.jacobian - there.jacobian).amax() < 1e-6);
            prop_assert!((model.tip_velocity_m_s - there.tip_velocity_m_s).amax() < 1e-6);
            prop_assert!((model.mass - there.mass).amax() < 1e-7);
            prop_assert!((model.bias_nm - there.bias_nm).amax() < 2e-5, "{:?} {:?}", model.bias_nm, there.bias_nm);
            prop_assert!((model.centripetal_m_s2 - there.centripetal_m_s2).amax() < 1e-5);
        }

        #[test]
        fn the_free_normal_acceleration_is_affine_in_the_torques(
            (arm, model) in model(), u1 in -5.0_f32..5.0, u2 in -5.0_f32..5.0,
        ) {
            let torque = JointTorque::new(u1, u2);
            let b = |torque: &JointTorque<f32>| {
                let pose = Pose::new(&model.theta_rad);
                arm.contact_terms(&model.theta_rad, &model.theta_dot_rad_s, &pose, &torque.to_links()).b_m_s2()
            };
            let change = b(&torque) - b(&JointTorque::zeros());
            let expected = model.free_slope_per_kg_m.dot(torque.vector());
            prop_assert!((change - expected).abs() < 1e-3 * (1.0 + b(&torque).abs()));
        }
    }
}

//! Equations of motion of the arm on a compliant contact, with the enabled effects.

use nalgebra::{SVector, Vector2};
use painleve_shared::{Arm, GeneralisedTorque, JointTorque, LinkMotion, Pose};

use super::contact::CompliantContact;
use crate::mechanics::belt::BeltProfile;
use crate::mechanics::effects::Effects;
use crate::mechanics::effects::friction::FrictionChange;
use crate::mechanics::moving_belt::MovingBelt;
use crate::mechanics::rosenbrock::Equations;
use crate::mechanics::torque::TorqueSegment;

/// Number of states of an arm with rigid, frictionless joints: θ1, θ2 (rad), θ̇1, θ̇2 (rad/s) and
/// the deflection y of the tip's bristles.
pub const PLAIN: usize = 5;

/// Number of states with drives: also the rotors' angles (rad) and rates (rad/s) in the joints'
/// coordinates θ1 and θ2 − θ1, and the deflections of the joints' bristles.
pub const WITH_DRIVES: usize = 11;

/// Number of states on a hanging belt, with or without drives: also the height (m) of its piece
/// under the tip, and its rate (m/s).
pub const FULL: usize = 13;

/// The equations of one stretch of motion.
#[derive(Clone, Copy, Debug)]
pub struct CompliantMotion<'a> {
    /// The arm.
    pub arm: &'a Arm<f64>,
    /// The belt.
    pub belt: &'a MovingBelt,
    /// Friction coefficient μ before any change.
    pub friction: f64,
    /// The contact's law.
    pub contact: &'a CompliantContact,
    /// The effects.
    pub effects: &'a Effects,
    /// Coulomb friction of the joints that the controller knows, N·m.
    pub joint_friction_nm: [f64; 2],
    /// Joint torques.
    pub torque: TorqueSegment,
}

/// State of the contact at the tip.
#[derive(Clone, Copy, Debug)]
pub struct Touch {
    /// Contact force (f_t, f_n), N.
    pub force_n: Vector2<f64>,
    /// Rate of the bristles, 1/s.
    pub bristle_rate_per_s: f64,
    /// Velocity of the tip along the belt, relative to the belt, m/s.
    pub slip_m_s: f64,
    /// Velocity at which tip and belt approach each other, m/s.
    pub closing_m_s: f64,
    /// Height of the belt's surface above the flat, unloaded belt, m.
    pub surface_m: f64,
}

impl CompliantMotion<'_> {
    /// Returns the contact at a state, whose pose of the arm and velocity of the tip (m/s) are known.
    fn touch<const N: usize>(
        &self,
        t_s: f64,
        x: &SVector<f64, N>,
        pose: &Pose<f64>,
        velocity_m_s: &Vector2<f64>,
    ) -> Touch {
        let bristles = x[4];
        let (hanging_m, hanging_m_s) = if N == FULL {
            (x[11], x[12])
        } else {
            (0.0, 0.0)
        };
        let slip_m_s = velocity_m_s.x - self.belt.profile().speed_m_s(t_s);
        let mut closing_m_s = hanging_m_s - velocity_m_s.y;
        let mut surface_m = hanging_m;
        let surface = &self.effects.surface;
        if !surface.is_flat() {
            let along_m = self.along_belt_m(t_s, self.arm.tip_m(pose).x);
            let here = surface.at(t_s, along_m);
            surface_m += here.height_m;
            closing_m_s += here.slope * slip_m_s + here.speed_m_s;
        }
        let friction = self.friction_at(t_s, self.arm.tip_m(pose).x);
        let depth_m = surface_m - self.arm.gap_m(pose);
        let normal = self.contact.normal_force_n(depth_m, closing_m_s);
        // In flight the bristles spring back.
        let rate = if normal > 0.0 {
            self.contact
                .bristle_rate_per_s(friction, slip_m_s, bristles)
        } else {
            -BRISTLE_RECOVERY_PER_S * bristles
        };
        let ratio = self.contact.friction_ratio(slip_m_s, bristles, rate);
        Touch {
            force_n: Vector2::new(normal * ratio, normal),
            bristle_rate_per_s: rate,
            slip_m_s,
            closing_m_s,
            surface_m,
        }
    }

    /// Returns the position on the belt, in a frame that moves with it, under a tip at `tip_t_m`,
    /// m.
    fn along_belt_m(&self, t_s: f64, tip_t_m: f64) -> f64 {
        tip_t_m - self.belt.displacement_m(t_s)
    }

    /// Returns the friction coefficient μ at a time and a tip position along the belt, m.
    pub fn friction_at(&self, t_s: f64, tip_t_m: f64) -> f64 {
        match &self.effects.friction {
            FrictionChange::None => self.friction,
            change => {
                let along_m = self.along_belt_m(t_s, tip_t_m);
                (self.friction + change.at(t_s, along_m)).max(0.0)
            }
        }
    }

    /// Returns the contact at a state.
    pub fn touch_at<const N: usize>(&self, t_s: f64, x: &SVector<f64, N>) -> Touch {
        let pose = Pose::new(&LinkMotion::new(x[0], x[1]));
        let velocity = self.arm.jacobian(&pose) * Vector2::new(x[2], x[3]);
        self.touch(t_s, x, &pose, &velocity)
    }
}

/// Rate at which the bristles spring back in flight, 1/s.
const BRISTLE_RECOVERY_PER_S: f64 = 1e3;

impl<const N: usize> Equations<N> for CompliantMotion<'_> {
    #[inline]
    fn derivative(&self, t_s: f64, x: &SVector<f64, N>) -> SVector<f64, N> {
        let angles = LinkMotion::new(x[0], x[1]);
        let rates = LinkMotion::new(x[2], x[3]);
        let pose = Pose::new(&angles);
        let jacobian = self.arm.jacobian(&pose);
        let velocity = jacobian * rates.vector();
        let touch = self.touch(t_s, x, &pose, &velocity);
        let mut derivative = SVector::<f64, N>::zeros();
        let mut joint_nm = self.torque.at(t_s).to_array();
        if N >= WITH_DRIVES {
            let joints = [(x[0], x[2]), (x[1] - x[0], x[3] - x[2])];
            let friction = &self.effects.joints;
            for (joint, (angle, rate)) in joints.into_iter().enumerate() {
                if self.effects.gear.elastic {
                    let (rotor, rotor_rate) = (x[5 + joint], x[7 + joint]);
                    let through = self
                        .effects
                        .gear
                        .torque_nm(rotor - angle, rotor_rate - rate);
                    derivative[5 + joint] = rotor_rate;
                    derivative[7 + joint] =
                        (joint_nm[joint] - through) / self.effects.gear.rotor_inertia_kg_m2;
                    joint_nm[joint] = through;
                }
                let bristles = x[9 + joint];
                derivative[9 + joint] = friction.bristle_rate_per_s(rate, bristles);
                joint_nm[joint] +=
                    friction.torque_nm(rate, bristles) - self.joint_friction_nm[joint] * bristles;
            }
        }
        let tip_force_n = touch.force_n + self.effects.push.force_n(t_s);
        let load = JointTorque::from_array(joint_nm).to_links()
            - self.arm.passive_torque_nm(&angles, &rates, &pose)
            - self.arm.centrifugal_torque_nm(&rates, &pose)
            + GeneralisedTorque::from_vector(jacobian.transpose() * tip_force_n);
        let acceleration = self.arm.inverse_mass_matrix(&pose) * load.vector();
        derivative[0] = rates.first();
        derivative[1] = rates.second();
        derivative[2] = acceleration.x;
        derivative[3] = acceleration.y;
        derivative[4] = touch.bristle_rate_per_s;
        if N == FULL && self.effects.hanging_belt.is_on() {
            let belt = &self.effects.hanging_belt;
            derivative[11] = x[12];
            derivative[12] = belt.acceleration_m_s2(x[11], x[12], touch.force_n.y);
        }
        derivative
    }

    fn is_autonomous(&self) -> bool {
        let still = matches!(self.belt.profile(), BeltProfile::Constant { .. });
        let effects = self.effects;
        still
            && self.torque.is_constant()
            && effects.friction == FrictionChange::None
            && effects.surface.is_flat()
    }
}

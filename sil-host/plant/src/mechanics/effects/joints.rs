//! Friction in the joints: Coulomb, static and viscous, modelled by bristles as in the tip's
//! contact, so that a joint can stand still under a torque.

use painleve_shared::settings;

/// Deflection of a joint's bristles before the joint slips, rad.
const BRISTLE_RAD: f64 = 1e-3;
/// Rate at which the excess of static friction has decayed to 1/e, rad/s.
const STRIBECK_RAD_S: f64 = 0.05;

settings! {
    /// Friction of both joints, in addition to the arm's viscous damping and Coulomb friction, and unknown to
    /// the controller.
    #[derive(Copy)]
    pub struct JointFriction {
        /// Coulomb friction.
        coulomb_nm: f64 = 0.0, 0.0..=10.0, "N·m";
        /// Ratio of static to Coulomb friction, also of the arm's.
        static_ratio: f64 = 1.0, 1.0..=5.0;
        /// Viscous friction.
        viscous_nms_rad: f64 = 0.0, 0.0..=10.0, "N·m·s/rad";
    }
}

impl JointFriction {
    /// Returns whether there is any friction.
    pub fn is_on(&self) -> bool {
        self.coulomb_nm != 0.0 || self.viscous_nms_rad != 0.0
    }

    /// Returns the rate (1/s) of a joint's bristles at a joint rate (rad/s); `bristles` is their
    /// deflection relative to that in steady slip.
    #[inline]
    pub fn bristle_rate_per_s(&self, rate_rad_s: f64, bristles: f64) -> f64 {
        let relative = rate_rad_s / STRIBECK_RAD_S;
        let ratio = 1.0 + (self.static_ratio - 1.0) * libm::exp(-relative * relative);
        (rate_rad_s - rate_rad_s.abs() * bristles / ratio) / BRISTLE_RAD
    }

    /// Returns the torque (N·m) on the joint.
    #[inline]
    pub fn torque_nm(&self, rate_rad_s: f64, bristles: f64) -> f64 {
        -self.coulomb_nm * bristles - self.viscous_nms_rad * rate_rad_s
    }
}

//! Elastic gears between motors and joints: stiffness, damping, backlash, and rotors with
//! independent motion.

use painleve_shared::settings;

settings! {
    /// Location of the encoders.
    #[derive(Copy, Eq)]
    pub enum EncoderSide {
        /// On the joint.
        "link" => Link,
        /// On the motor side of the gear.
        "motor" => Motor,
    }
}

settings! {
    /// The gears of both joints; all quantities are referred to the joint.
    #[derive(Copy)]
    pub struct GearSettings {
        /// Whether the gears are elastic.
        elastic: bool = false;
        /// Stiffness.
        stiffness_nm_rad: f64 = 500.0, 1.0..=1e6, "N·m/rad";
        /// Damping.
        damping_nms_rad: f64 = 0.05, 0.0..=1e3, "N·m·s/rad";
        /// Backlash, end to end.
        backlash_deg: f64 = 0.0, 0.0..=10.0, "°";
        /// Inertia of each rotor, in addition to that of the arm.
        rotor_inertia_kg_m2: f64 = 1e-4, 1e-7..=1.0, "kg·m²";
        /// Location of the encoders.
        encoder_side: EncoderSide = EncoderSide::Link;
    }
}

impl GearSettings {
    /// Returns the torque (N·m) on a joint whose rotor leads by a twist (rad) with a rate (rad/s).
    #[inline]
    pub fn torque_nm(&self, twist_rad: f64, twist_rate_rad_s: f64) -> f64 {
        let half = 0.5 * self.backlash_deg.to_radians();
        let strain = if twist_rad > half {
            twist_rad - half
        } else if twist_rad < -half {
            twist_rad + half
        } else {
            return 0.0;
        };
        self.stiffness_nm_rad * strain + self.damping_nms_rad * twist_rate_rad_s
    }
}

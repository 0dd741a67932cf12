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
        let strain = twist_rad - twist_rad.clamp(-half, half);
        let torque = self.stiffness_nm_rad * strain + self.damping_nms_rad * twist_rate_rad_s;
        // With backlash each flank only pushes.
        if half == 0.0 {
            torque
        } else if strain > 0.0 {
            torque.max(0.0)
        } else if strain < 0.0 {
            torque.min(0.0)
        } else {
            0.0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flank_pushes_only_and_a_gear_without_backlash_also_damps_without_twist() {
        let gear = |backlash_deg| GearSettings {
            backlash_deg,
            ..Default::default()
        };
        let loose = gear(1.0);
        let flank_rad = 0.5_f64.to_radians();
        for side in [1.0, -1.0] {
            let torque_nm = |inside_rad, rate| {
                side * loose.torque_nm(side * (flank_rad + inside_rad), side * rate)
            };
            assert_eq!(torque_nm(1e-6, -1.0), 0.0);
            assert_eq!(torque_nm(-1e-6, 1.0), 0.0);
            assert!((torque_nm(1e-3, -1.0) - 0.45).abs() < 1e-12);
        }
        assert_eq!(gear(0.0).torque_nm(0.0, 1.0), 0.05);
        assert!(gear(0.0).torque_nm(1e-6, -1.0) < 0.0);
    }
}

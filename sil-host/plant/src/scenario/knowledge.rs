//! How well the geometry of an arm is known.

use painleve_shared::settings;

/// Beginning of the source of what a rehearsal has measured.
const REHEARSAL: &str = "rehearsal";

settings! {
    /// Standard deviations of an arm's geometry and joints, as `painleve commission` and `identify` have written them: a record of
    /// how the arm is known. The values are in `arm_model` and `controller.estimator.encoders`. The controller needs what follows from
    /// them for the tip, `controller.estimator.tip_deviation_m`.
    pub struct Knowledge {
        /// Where values and deviations come from.
        source: String = "exactly known".into();
        /// Standard deviation of each encoder's zero. It is strongly correlated with the encoder's error once around.
        encoder_zero_rad: [f64; 2] = [0.0; 2], 0.0..=1.0, "rad";
        /// Standard deviation of each encoder's error once around in a turn: the larger of sine and cosine.
        encoder_once_rad: [f64; 2] = [0.0; 2], 0.0..=1.0, "rad";
        /// Standard deviation of the same twice around.
        encoder_twice_rad: [f64; 2] = [0.0; 2], 0.0..=1.0, "rad";
        /// Standard deviation of each link's length.
        link_length_m: [f64; 2] = [0.0; 2], 0.0..=10.0, "m";
        /// Standard deviation of the height of joint 1 over the belt.
        height_m: f64 = 0.0, 0.0..=20.0, "m";
        /// Standard deviation of the tip's position along the belt, if link 1 has its stated length.
        tip_m: f64 = 0.0, 0.0..=1.0, "m";
        /// Part of `controller.estimator.tip_deviation_m` that you set, such as for play of the gears. Once the arm is
        /// commissioned or identified, change this key only: commands compute the other.
        told_m: f64 = 0.0, 0.0..=1.0, "m";
        /// Distance of the tip from a straight line in the slides, root mean square.
        off_line_m: f64 = 0.0, 0.0..=1.0, "m";
        /// Acceleration of the tip off the belt by waves, vibration and torques that the controller does not know, root mean
        /// square in the slides. `controller.governor.p_per_kg` follows from it.
        ripple_m_s2: f64 = 0.0, 0.0..=1e6, "m/s²";
        /// Standard deviation of each joint's Coulomb friction.
        coulomb_friction_nm: [f64; 2] = [0.0; 2], 0.0..=1e4, "N·m";
        /// Standard deviation of the stiffness of the spring in each joint.
        stiffness_nm_rad: [f64; 2] = [0.0; 2], 0.0..=1e6, "N·m/rad";
    }
}

impl Knowledge {
    /// Returns the source of what a rehearsal with this seed has measured: a simulated arm.
    pub fn rehearsal(seed: u64) -> String {
        format!("{REHEARSAL} with seed {seed}")
    }

    /// Returns whether a rehearsal has written it: it describes no real arm.
    pub fn is_rehearsed(&self) -> bool {
        self.source.starts_with(REHEARSAL)
    }
}

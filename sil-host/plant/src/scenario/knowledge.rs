//! How well the geometry of an arm is known.

use painleve_shared::{ArmParameters, settings};

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
        /// square in the slides; the force cell's noise adds to it. `controller.governor.p_per_kg` follows from it.
        ripple_m_s2: f64 = 0.0, 0.0..=1e6, "m/s²";
        /// Standard deviation of each joint's Coulomb friction; 0 if no slide has shown it.
        coulomb_friction_nm: [f64; 2] = [0.0; 2], 0.0..=1e4, "N·m";
        /// Standard deviation of the stiffness of the spring in each joint; 0 if no slide has shown it.
        stiffness_nm_rad: [f64; 2] = [0.0; 2], 0.0..=1e6, "N·m/rad";
    }
}

impl Knowledge {
    /// Returns the source of what a rehearsal with this seed has measured: a simulated arm.
    pub fn rehearsal(seed: u64) -> String {
        format!("{REHEARSAL} with seed {seed}")
    }

    /// Returns the same of what was measured otherwise of a simulated arm.
    pub fn of_simulation(source: &str) -> String {
        format!("{REHEARSAL}: {source}")
    }

    /// Returns in words what leaves the tip's place on the belt most uncertain, each parameter taken alone; `None` if all
    /// are known exactly.
    pub fn chief_doubt(&self, arm: &ArmParameters<f32>) -> Option<String> {
        let levers_m = [arm.height_m, arm.link_length_m[1]].map(f64::from);
        let turns = [
            ("the encoders' zeros are", self.encoder_zero_rad),
            (
                "the encoders' errors once around are",
                self.encoder_once_rad,
            ),
            (
                "the encoders' errors twice around are",
                self.encoder_twice_rad,
            ),
        ];
        let turns = turns.map(|(what, rad)| {
            let effect_m = (rad[0] * levers_m[0]).max(rad[1] * levers_m[1]);
            let degrees = rad[0].max(rad[1]).to_degrees();
            (effect_m, format!("{what} known to {degrees:.2}°"))
        });
        let length_m = self.link_length_m[0].max(self.link_length_m[1]);
        let distances = [
            ("the links' lengths are", length_m),
            ("the height over the belt is", self.height_m),
            ("the tip is, as you told,", self.told_m),
        ];
        let distances = distances.map(|(what, effect_m)| {
            let mm = 1e3 * effect_m;
            (effect_m, format!("{what} known to {mm:.2} mm"))
        });
        let all = turns.into_iter().chain(distances);
        let (effect_m, text) = all.max_by(|one, other| one.0.total_cmp(&other.0))?;
        (effect_m > 0.0).then_some(text)
    }

    /// Returns whether a rehearsal has written it: it describes no real arm.
    pub fn is_rehearsed(&self) -> bool {
        self.source.starts_with(REHEARSAL)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_parameter_that_moves_the_tip_most_is_named() {
        let arm = ArmParameters::default();
        assert_eq!(Knowledge::default().chief_doubt(&arm), None);
        let mut knowledge = Knowledge {
            encoder_zero_rad: [0.005, 0.001],
            link_length_m: [0.001, 0.0015],
            ..Knowledge::default()
        };
        let doubt = |knowledge: &Knowledge| knowledge.chief_doubt(&arm).unwrap_or_default();
        assert_eq!(doubt(&knowledge), "the encoders' zeros are known to 0.29°");
        knowledge.encoder_zero_rad = [0.001; 2];
        assert_eq!(doubt(&knowledge), "the links' lengths are known to 1.50 mm");
        knowledge.told_m = 0.002;
        assert_eq!(
            doubt(&knowledge),
            "the tip is, as you told, known to 2.00 mm"
        );
    }
}

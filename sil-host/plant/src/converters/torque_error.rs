//! Errors between the commanded torque and the torque at the joint.
//!
//! τ = L((1 + g) D(u)) (1 + r sin nθ) + c sin nθ + τ_pulse, with the dead zone D, the stage's own limit L, the joint angle
//! θ and n periods in a turn.
//! It is evaluated where the torque changes, once per tick, and held until the next change.

use core::f64::consts::TAU;

use painleve_shared::{JointMotion, JointTorque, settings};

settings! {
    /// Errors of both torque stages and their motors.
    #[derive(Copy)]
    pub struct TorqueErrorSettings {
        /// Relative error g of the gain of each joint.
        gain: [f64; 2] = [0.0; 2], -1.0..=10.0;
        /// Largest torque that each stage gives, which the controller does not know; no limit if absent.
        limit_nm: Option<[f64; 2]> = None, 0.0..=1e6, "N·m";
        /// Dead zone: reduces the magnitude of a commanded torque by this amount, to zero for
        /// smaller torques.
        dead_zone_nm: f64 = 0.0, 0.0..=1e6, "N·m";
        /// Amplitude r of the ripple relative to the torque.
        ripple: f64 = 0.0, 0.0..=1.0;
        /// Amplitude c of the cogging torque.
        cogging_nm: f64 = 0.0, 0.0..=1e6, "N·m";
        /// Periods n of ripple and cogging in a turn of the joint.
        periods_per_turn: u32 = 24, 1..=100_000;
        /// Additional torque on each joint while the pulse lasts.
        pulse_nm: [f64; 2] = [0.0; 2], -1e6..=1e6, "N·m";
        /// Start of the pulse.
        pulse_at_s: f64 = 1.0, 0.0..=1e7, "s";
        /// Duration of the pulse, from tick to tick.
        pulse_duration_s: f64 = 0.005, 0.0..=1e7, "s";
    }
}

impl TorqueErrorSettings {
    /// Returns the torque at the joints for a command (N·m) at joint angles (rad) and a time (s).
    #[inline]
    pub fn applied_nm(
        &self,
        command_nm: JointTorque<f64>,
        joints_rad: &JointMotion<f64>,
        time_s: f64,
    ) -> JointTorque<f64> {
        if *self == Self::default() {
            return command_nm;
        }
        let is_pulse =
            time_s >= self.pulse_at_s && time_s < self.pulse_at_s + self.pulse_duration_s;
        let commands = command_nm.to_array();
        let angles = joints_rad.to_array();
        let mut applied = [0.0; 2];
        for (joint, torque_nm) in applied.iter_mut().enumerate() {
            let command_nm = commands[joint];
            let beyond_nm = (command_nm.abs() - self.dead_zone_nm)
                .max(0.0)
                .copysign(command_nm);
            let turns = angles[joint] / TAU * f64::from(self.periods_per_turn);
            let wave = libm::sin(TAU * turns);
            let mut given_nm = (1.0 + self.gain[joint]) * beyond_nm;
            if let Some(limits_nm) = self.limit_nm {
                given_nm = given_nm.clamp(-limits_nm[joint], limits_nm[joint]);
            }
            *torque_nm = given_nm * (1.0 + self.ripple * wave) + self.cogging_nm * wave;
            if is_pulse {
                *torque_nm += self.pulse_nm[joint];
            }
        }
        JointTorque::from_array(applied)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn applied(errors: &TorqueErrorSettings, command: f64, angle: f64, time_s: f64) -> f64 {
        let command = JointTorque::new(command, 0.0);
        let angles = JointMotion::new(angle, 0.0);
        errors.applied_nm(command, &angles, time_s).first()
    }

    #[test]
    fn without_errors_the_command_is_applied_bit_for_bit() {
        let none = TorqueErrorSettings::default();
        assert_eq!(
            applied(&none, 0.1 + 0.2, 0.7, 1.0).to_bits(),
            (0.1_f64 + 0.2).to_bits()
        );
    }

    #[test]
    fn a_pulse_lasts_from_its_start_to_its_end_and_dead_zone_and_limit_are_symmetric() {
        let pulse = TorqueErrorSettings {
            pulse_nm: [0.5, 0.0],
            ..Default::default()
        };
        let at = |time_s| applied(&pulse, 1.0, 0.0, time_s);
        assert_eq!(
            [at(0.999), at(1.0), at(1.004), at(1.005)],
            [1.0, 1.5, 1.5, 1.0]
        );
        let dead = TorqueErrorSettings {
            dead_zone_nm: 0.25,
            ..Default::default()
        };
        let through = [-1.0, -0.2, 0.2, 1.0].map(|command| applied(&dead, command, 0.0, 0.0));
        assert_eq!(through, [-0.75, 0.0, 0.0, 0.75]);
        let limited = TorqueErrorSettings {
            limit_nm: Some([0.5, 1.0]),
            gain: [1.0, 0.0],
            ..Default::default()
        };
        let given = [-1.0, -0.2, 0.2, 1.0].map(|command| applied(&limited, command, 0.0, 0.0));
        assert_eq!(given, [-0.5, -0.4, 0.4, 0.5]);
    }

    proptest! {
        #[test]
        fn ripple_grows_with_the_torque_and_cogging_does_not(
            command in -3.0_f64..3.0, angle in -3.0_f64..3.0, gain in -0.5_f64..0.5,
            ripple in 0.0_f64..0.5, cogging_nm in 0.0_f64..0.5, periods in 1_u32..100,
        ) {
            let errors = TorqueErrorSettings {
                gain: [gain, 0.0],
                ripple,
                cogging_nm,
                periods_per_turn: periods,
                ..Default::default()
            };
            let wave = libm::sin(f64::from(periods) * angle);
            let expected = (1.0 + gain) * command * (1.0 + ripple * wave) + cogging_nm * wave;
            prop_assert!((applied(&errors, command, angle, 0.0) - expected).abs() < 1e-10);
        }
    }
}

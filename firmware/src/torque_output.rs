//! Converts a law's torque to counts: checked, limited and rounded.

use painleve_shared::counts::{LinearConverter, LinearScale, TorqueCounts};
use painleve_shared::status::Fault;
use painleve_shared::{JointTorque, Real};

use crate::last_command::LastCommand;
use crate::law::LawOutput;

/// Limits torques and converts them to counts of the torque stages.
#[derive(Clone, Copy, Debug)]
pub struct TorqueOutput {
    converter: LinearConverter<f32>,
    /// Largest torque, counts.
    limit: i32,
}

impl TorqueOutput {
    /// Makes an output with this scale, of which ±`limit_nm` (N·m) is used.
    pub fn new(scale: LinearScale<f32>, limit_nm: f32) -> Self {
        let converter = scale.converter();
        let limit = (limit_nm / converter.per_count).truncate_to_i32();
        let limit = limit.min(converter.maximum_counts);
        Self { converter, limit }
    }

    /// Returns the largest torque that it gives, N·m.
    pub fn limit_nm(&self) -> f32 {
        self.converter.value(self.limit)
    }

    /// Returns the counts that are given where these are wanted.
    #[inline]
    pub fn limited(&self, counts: i32) -> i32 {
        counts.max(-self.limit).min(self.limit)
    }

    /// Converts a law's answer at one tick to a command: limits the desired torques and rounds them to counts.
    ///
    /// # Errors
    /// [`Fault::NotFinite`] if the law's torque, or the square of its contact force, is not a finite number; the command stays
    /// unchanged.
    #[inline]
    pub fn tick(&self, command: &mut LastCommand, output: &LawOutput) -> Result<(), Fault> {
        let (wanted_nm, force_n) = (output.torque_nm, &output.contact_force_n);
        // Check before clamping, which would turn an infinity into a limit. The sum is finite only if all are; with the square
        // of the force, the acceleration by it is, too.
        if !(wanted_nm.first() + wanted_nm.second() + force_n.norm_squared()).is_finite() {
            return Err(Fault::NotFinite);
        }
        // Carry the rounding remainder to the next tick: near the edge, where p is small, half a
        // count of constant torque would cause one newton of force.
        let owed = wanted_nm + command.rounding_nm;
        let nearest = owed.to_array().map(|torque| self.converter.nearest(torque));
        let counts = nearest.map(|counts| self.limited(counts));
        let given = counts.map(|counts| self.converter.value(counts));
        command.counts = counts.map(TorqueCounts);
        command.torque_nm = JointTorque::from_array(given);
        command.saturated = counts != nearest;
        // What the limit withholds is not owed.
        let withheld = (owed - command.torque_nm).to_array();
        let rounding = [0, 1].map(|joint| {
            let is_limited = counts[joint] != nearest[joint];
            if is_limited { 0.0 } else { withheld[joint] }
        });
        command.rounding_nm = JointTorque::from_array(rounding);
        command.contact_force_n = output.contact_force_n;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector2;

    use super::*;

    fn stages() -> TorqueOutput {
        let scale = LinearScale {
            bits: 12,
            range: 5.0,
        };
        TorqueOutput::new(scale, 5.0)
    }

    fn limit(command: &mut LastCommand, torque_nm: &JointTorque<f32>) -> Result<(), Fault> {
        let output = LawOutput {
            torque_nm: *torque_nm,
            ..Default::default()
        };
        stages().tick(command, &output)
    }

    #[test]
    fn a_torque_or_force_that_is_not_a_number_is_refused() {
        for (bad, places) in [(f32::NAN, 0..4), (f32::INFINITY, 0..4), (1e38, 2..4)] {
            for place in places {
                let mut values = [0.0; 4];
                values[place] = bad;
                let [first, second, tangential, normal] = values;
                let output = LawOutput {
                    torque_nm: JointTorque::new(first, second),
                    contact_force_n: Vector2::new(tangential, normal),
                };
                let mut command = LastCommand::default();
                let refused = stages().tick(&mut command, &output);
                assert_eq!(refused, Err(Fault::NotFinite), "{values:?}");
                assert_eq!(command, LastCommand::default());
            }
        }
    }

    #[test]
    fn the_rounding_remainder_is_carried_to_later_ticks() {
        let count = stages().converter.per_count;
        let wanted = JointTorque::new(0.3 * count, -0.3 * count);
        let mut command = LastCommand::default();
        let mut sum = JointTorque::zeros();
        for _ in 0..100 {
            limit(&mut command, &wanted).unwrap();
            sum += command.torque_nm;
        }
        assert!((sum - wanted * 100.0).amax() <= count, "{sum:?}");
    }

    #[test]
    fn a_torque_beyond_the_limit_is_limited_and_flagged() {
        let mut command = LastCommand::default();
        limit(&mut command, &JointTorque::new(7.0, -1.0)).unwrap();
        assert!(command.saturated);
        assert!(command.torque_nm.first() <= 5.0);
        limit(&mut command, &JointTorque::new(4.0, -1.0)).unwrap();
        assert!(!command.saturated);
    }

    #[test]
    fn what_the_limit_withholds_is_not_owed_and_the_other_joint_keeps_its_remainder() {
        let scale = LinearScale {
            bits: 12,
            range: 5.0,
        };
        let output = TorqueOutput::new(scale, 2.0);
        let rest_nm = 0.3 * output.converter.per_count;
        let wanted = LawOutput {
            torque_nm: JointTorque::new(-7.0, rest_nm),
            ..Default::default()
        };
        let mut command = LastCommand::default();
        output.tick(&mut command, &wanted).unwrap();
        assert!(command.saturated);
        assert!((command.torque_nm.first() + 2.0).abs() <= 0.5 * output.converter.per_count);
        assert_eq!(command.rounding_nm.to_array(), [0.0, rest_nm]);
    }
}

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
    limit_nm: f32,
}

impl TorqueOutput {
    /// Makes an output with this scale, of which ±`limit_nm` (N·m) is used.
    pub fn new(scale: LinearScale<f32>, limit_nm: f32) -> Self {
        Self {
            converter: scale.converter(),
            limit_nm,
        }
    }

    /// Converts a law's answer at one tick to a command: limits the desired torques and rounds them to counts.
    ///
    /// # Errors
    /// [`Fault::NotFinite`] if the law's torque is not a finite number; the command stays unchanged.
    #[inline]
    pub fn tick(&self, command: &mut LastCommand, output: &LawOutput) -> Result<(), Fault> {
        let wanted_nm = output.torque_nm;
        // Check before clamping, which would turn an infinity into a limit.
        if !(wanted_nm.first().is_finite() && wanted_nm.second().is_finite()) {
            return Err(Fault::NotFinite);
        }
        // Carry the rounding remainder to the next tick: near the edge, where p is small, half a
        // count of constant torque would cause one newton of force.
        let owed = (wanted_nm + command.rounding_nm).map(|torque| torque.within(self.limit_nm));
        let converter = &self.converter;
        let (counts_1, over_1) = converter.counts(owed.first());
        let (counts_2, over_2) = converter.counts(owed.second());
        let given = JointTorque::new(converter.value(counts_1), converter.value(counts_2));
        let half = 0.5 * converter.per_count;
        command.counts = [TorqueCounts(counts_1), TorqueCounts(counts_2)];
        command.torque_nm = given;
        command.saturated = over_1 || over_2 || wanted_nm.amax() > self.limit_nm;
        command.rounding_nm = (owed - given).map(|rest| rest.within(half));
        command.contact_force_n = output.contact_force_n;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
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
    fn a_torque_that_is_not_a_number_is_refused() {
        for wanted in [
            JointTorque::new(f32::NAN, 0.0),
            JointTorque::new(0.0, f32::INFINITY),
        ] {
            let mut command = LastCommand::default();
            assert_eq!(limit(&mut command, &wanted), Err(Fault::NotFinite));
            assert_eq!(command, LastCommand::default());
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
}

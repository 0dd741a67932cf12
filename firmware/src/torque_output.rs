//! Converts a law's torque to counts: guarded against lift-off, limited, rounded and checked.

use painleve_shared::counts::{LinearConverter, LinearScale, TorqueCounts};
use painleve_shared::{JointTorque, Real};

use crate::estimate::ContactEstimate;
use crate::estimate::model::Model;
use crate::guard::{GuardSettings, HalfPlane, nearest_torque_nm};
use crate::last_command::LastCommand;
use crate::law::LawOutput;

/// A requested torque is not a finite number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotFinite;

/// Limits torques and converts them to counts of the torque stages.
#[derive(Clone, Copy, Debug)]
pub struct TorqueOutput {
    guard: GuardSettings,
    converter: LinearConverter<f32>,
    limit_nm: f32,
}

impl TorqueOutput {
    /// Makes an output with this scale, of which ±`limit_nm` (N·m) is used.
    pub fn new(guard: &GuardSettings, scale: LinearScale<f32>, limit_nm: f32) -> Self {
        Self {
            guard: *guard,
            converter: scale.converter(),
            limit_nm,
        }
    }

    /// Converts a law's answer at one tick to a command.
    ///
    /// # Errors
    /// [`NotFinite`] if the law's torque is not a finite number; the command stays unchanged.
    #[inline]
    pub fn tick(
        &self,
        command: &mut LastCommand,
        output: &LawOutput,
        model: &Model,
        contact: &ContactEstimate,
    ) -> Result<(), NotFinite> {
        let (wanted_nm, guarded) = self.pressed(&output.torque_nm, model, contact);
        self.limit(command, &wanted_nm)?;
        command.guarded = guarded;
        command.contact_force_n = output.contact_force_n;
        Ok(())
    }

    /// Returns the torque (N·m) closest to the wanted one that keeps a sliding tip pressed on the
    /// belt, and whether it differs from the wanted one.
    #[inline]
    fn pressed(
        &self,
        wanted_nm: &JointTorque<f32>,
        model: &Model,
        contact: &ContactEstimate,
    ) -> (JointTorque<f32>, bool) {
        let friction = &contact.friction;
        let slides = contact.touches && friction.slip_seen && contact.p_per_kg > 0.0;
        // The guard assumes a rigid contact, and would cut the impulse that a contact that gives has missed.
        let catches_up = friction.catch_up != 0.0;
        if !(self.guard.enabled && slides) || catches_up {
            return (*wanted_nm, false);
        }
        let plane = HalfPlane {
            normal: model.free_slope_per_kg_m,
            bound: -contact.p_per_kg * self.guard.minimum_force_n - model.free_offset_m_s2,
        };
        match nearest_torque_nm(wanted_nm, &plane, self.limit_nm) {
            (nearest_nm, true) => (nearest_nm, true),
            // The torque limit is not applied here: limiting is flagged below.
            (_, false) => (*wanted_nm, false),
        }
    }

    /// Limits the wanted torques and converts them to counts.
    #[inline]
    fn limit(
        &self,
        command: &mut LastCommand,
        wanted_nm: &JointTorque<f32>,
    ) -> Result<(), NotFinite> {
        // Check before clamping, which would turn an infinity into a limit.
        if !(wanted_nm.first().is_finite() && wanted_nm.second().is_finite()) {
            return Err(NotFinite);
        }
        // Carry the rounding remainder to the next tick: near the edge, where p is small, half a
        // count of constant torque would cause one newton of force.
        let owed = (*wanted_nm + command.rounding_nm).map(|torque| torque.within(self.limit_nm));
        let converter = &self.converter;
        let (counts_1, over_1) = converter.counts(owed.first());
        let (counts_2, over_2) = converter.counts(owed.second());
        let given = JointTorque::new(converter.value(counts_1), converter.value(counts_2));
        let half = 0.5 * converter.per_count;
        command.counts = [TorqueCounts(counts_1), TorqueCounts(counts_2)];
        command.torque_nm = given;
        command.saturated = over_1 || over_2 || wanted_nm.amax() > self.limit_nm;
        command.rounding_nm = (owed - given).map(|rest| rest.within(half));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimate::friction::FrictionEstimate;
    use crate::estimate::response::ContactResponse;
    use nalgebra::Vector2;
    use painleve_shared::{Arm, ArmParameters, GeneralisedTorque, LinkMotion, Posture, Slip};

    fn stages() -> TorqueOutput {
        let scale = LinearScale {
            bits: 12,
            range: 5.0,
        };
        TorqueOutput::new(&GuardSettings::default(), scale, 5.0)
    }

    #[test]
    fn a_torque_that_is_not_a_number_is_refused() {
        for wanted in [
            JointTorque::new(f32::NAN, 0.0),
            JointTorque::new(0.0, f32::INFINITY),
        ] {
            let mut command = LastCommand::default();
            assert_eq!(stages().limit(&mut command, &wanted), Err(NotFinite));
            assert_eq!(command, LastCommand::default());
        }
    }

    #[test]
    fn the_guard_presses_a_tip_that_slides_unless_the_law_catches_up() {
        let arm = Arm::<f32>::new(ArmParameters::default()).unwrap();
        let theta_rad = arm
            .link_angles_on_belt_rad(0.0, Posture::ElbowDown)
            .unwrap();
        let model = Model::new(
            &arm,
            theta_rad,
            LinkMotion::zeros(),
            &GeneralisedTorque::zeros(),
        );
        let mut contact = ContactEstimate {
            touches: true,
            lands: false,
            leaves: false,
            in_flight: false,
            force_n: Vector2::new(-6.0, 10.0),
            friction: FrictionEstimate {
                coefficient: 0.6,
                next_coefficient: 0.6,
                catch_up: 0.0,
                deviation: 0.0,
                slip: Slip::Positive,
                slip_seen: true,
                sticks: false,
            },
            p_per_kg: model.p_per_kg(0.6, Slip::Positive),
            p_ratio: 0.5,
            response: ContactResponse::rigid(1.0),
        };
        // A torque that lifts the tip.
        let lifting = model.torque_against_nm(&Vector2::new(0.0, -10.0));
        let (pressed, guarded) = stages().pressed(&lifting, &model, &contact);
        assert!(guarded && pressed != lifting);
        contact.friction.catch_up = -0.3;
        let result = stages().pressed(&lifting, &model, &contact);
        assert_eq!(result, (lifting, false));
    }

    #[test]
    fn the_rounding_remainder_is_carried_to_later_ticks() {
        let count = stages().converter.per_count;
        let wanted = JointTorque::new(0.3 * count, -0.3 * count);
        let mut command = LastCommand::default();
        let mut sum = JointTorque::zeros();
        for _ in 0..100 {
            stages().limit(&mut command, &wanted).unwrap();
            sum += command.torque_nm;
        }
        assert!((sum - wanted * 100.0).amax() <= count, "{sum:?}");
    }

    #[test]
    fn a_torque_beyond_the_limit_is_limited_and_flagged() {
        let mut command = LastCommand::default();
        stages()
            .limit(&mut command, &JointTorque::new(7.0, -1.0))
            .unwrap();
        assert!(command.saturated && command.is_constrained());
        assert!(command.torque_nm.first() <= 5.0);
        stages()
            .limit(&mut command, &JointTorque::new(4.0, -1.0))
            .unwrap();
        assert!(!command.is_constrained());
    }
}

//! From a law's answer to counts: kept on the belt, limited, checked.

use nalgebra::Vector2;
use painleve_shared::Real;
use painleve_shared::counts::TorqueCounts;
use painleve_shared::status::Fault;

use super::Controller;
use super::observation::Observation;
use crate::estimate::model::Model;
use crate::guard::{HalfPlane, nearest_torque_nm};
use crate::law::signals::LawOutput;

impl Controller {
    /// Turns a law's answer into counts: kept on the belt, limited, checked.
    pub(super) fn drive(&mut self, output: &LawOutput, model: &Model, observed: &Observation) {
        let mut torque_nm = output.torque_nm;
        let guard = self.configuration.settings.guard;
        let slides = observed.contact && observed.friction.slip_seen && observed.p_per_kg > 0.0;
        if guard.enabled && slides {
            let (offset, normal) = model.free_normal_acceleration();
            let plane = HalfPlane {
                normal,
                bound: -observed.p_per_kg * guard.minimum_force_n - offset,
            };
            let limit = self.configuration.settings.torque_limit_nm;
            let (guarded_nm, acted) = nearest_torque_nm(&torque_nm, &plane, limit);
            if acted {
                torque_nm = guarded_nm;
                self.telemetry.guarded = true;
                self.telemetry.guarded_ticks = self.telemetry.guarded_ticks.wrapping_add(1);
            }
        }
        self.apply(&torque_nm);
        let given_nm = Vector2::from(self.telemetry.torque_nm);
        let of_encoders = |theta: Vector2<f32>| Vector2::new(theta.x, theta.y - theta.x);
        self.contact_acceleration =
            of_encoders(model.contact_acceleration_rad_s2(&output.contact_force_n));
        self.expected_acceleration =
            of_encoders(model.free_acceleration_rad_s2(&given_nm)) + self.contact_acceleration;
    }

    /// Limits the wanted torques and turns them into counts.
    pub(super) fn apply(&mut self, wanted_nm: &Vector2<f32>) {
        // Before clamping, which would turn an infinity into a limit.
        if !(wanted_nm.x.is_finite() && wanted_nm.y.is_finite()) {
            self.supervisor.latch(Fault::NotFinite);
            return;
        }
        let limit = self.configuration.settings.torque_limit_nm;
        let scale = self.configuration.converters.torque;
        // What rounding took away is given with the next tick: near the edge, where p is
        // small, half a count of constant torque would be a newton of force.
        let owed = (wanted_nm + self.rounding_nm).map(|torque| torque.within(limit));
        let (counts_1, over_1) = scale.counts(owed.x);
        let (counts_2, over_2) = scale.counts(owed.y);
        let given = Vector2::new(scale.value(counts_1), scale.value(counts_2));
        let half = 0.5 * scale.per_count();
        self.rounding_nm = (owed - given).map(|rest| rest.within(half));
        let saturated = over_1 || over_2 || wanted_nm.amax() > limit;
        self.answer.torques = [TorqueCounts(counts_1), TorqueCounts(counts_2)];
        self.telemetry.torque_nm = given.into();
        self.telemetry.saturated = saturated;
        if saturated {
            self.telemetry.saturated_ticks = self.telemetry.saturated_ticks.wrapping_add(1);
        }
    }
}

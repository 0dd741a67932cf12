//! What a tick's readings say: about contact, friction, the belt, the links and unknown torques.

use nalgebra::Vector2;
use painleve_shared::frame::SensorFrame;

use super::Controller;
use crate::estimate::contact::{EncoderReading, Evidence};
use crate::estimate::disturbance::Balance;
use crate::estimate::friction::FrictionEstimate;
use crate::estimate::model::Model;

/// Friction above the estimate that a throw may be explained by.
const THROWN_BY_FRICTION: f32 = 0.4;

/// What is known after a tick's readings.
pub(super) struct Observation {
    /// Whether the tip touches, and whether it did before.
    pub contact: bool,
    pub touched: bool,
    /// Contact force (f_t, f_n), N.
    pub force_n: Vector2<f32>,
    /// What is known about friction, and p with it, 1/kg.
    pub friction: FrictionEstimate,
    pub p_per_kg: f32,
}

impl Controller {
    /// Takes in a frame's readings, `elapsed_ticks` after the ones before.
    pub(super) fn observe(
        &mut self,
        model: &Model,
        frame: &SensorFrame,
        elapsed_ticks: u32,
    ) -> Observation {
        let scale = self.configuration.converters.force;
        let force_n = Vector2::new(
            scale.value(frame.tangential_force.0),
            scale.value(frame.normal_force.0),
        );
        // At the end of its range the force cell shows less than there is.
        let range = scale.maximum_counts();
        let in_range = [frame.tangential_force, frame.normal_force]
            .iter()
            .all(|force| force.0.abs() < range);
        let gap_m = self.gap_m(model);
        let touched = self.contact.contact();
        let contact = match self.configuration.settings.contact.evidence {
            Evidence::ForceCell => self.contact.update_from_force(force_n.y),
            Evidence::Encoders => {
                let mut encoders = self.encoder_reading(model, gap_m);
                self.find_belt(&mut encoders);
                self.contact.update_from_encoders(&encoders)
            }
        };
        let certain = self.contact.is_certain();
        if contact {
            if !touched && let Some(slip) = self.belt.slip(model.tip_velocity_m_s.x) {
                self.friction.expect_slip(slip);
            }
            if in_range {
                self.friction.update(&force_n);
            }
            // A reading that stays would weigh more for nothing but time.
            if certain && self.estimator.moved() {
                let length = self.calibration.update(gap_m);
                self.arm = self.arm.with_link_length(length);
            }
        } else if touched {
            self.thrown(model);
        }
        let friction = self.friction.estimate();
        self.belt.update(
            model.tip_velocity_m_s.x,
            contact.then_some(&friction),
            self.tick_s,
        );
        let p_per_kg = model.p_per_kg(friction.coefficient, friction.slip);
        if certain && in_range && self.supervisor.drives() {
            self.disturbance.update(
                model,
                &Balance {
                    torque_nm: self.telemetry.torque_nm.into(),
                    force_n,
                    p_per_kg: contact.then_some(p_per_kg),
                    elapsed_s: elapsed_ticks as f32 * self.tick_s,
                },
            );
        } else {
            self.disturbance.pause();
        }
        Observation {
            contact,
            touched,
            force_n,
            friction,
            p_per_kg,
        }
    }

    /// Where the encoders decide, the belt is taken to be where the tip was lowest: where it
    /// starts, and from then on wherever it gets below that.
    fn find_belt(&mut self, encoders: &mut EncoderReading) {
        let starts = self.calibration.is_open();
        if starts || encoders.is_below_belt() {
            let length = self.calibration.restart(encoders.gap_m);
            self.arm = self.arm.with_link_length(length);
        }
        if starts {
            encoders.gap_m = 0.0;
        }
    }

    /// Measured height of the tip over the belt, m.
    fn gap_m(&self, model: &Model) -> f32 {
        let residual = self.estimator.innovation_rad() * self.estimator.residual_share();
        let jacobian = &model.jacobian;
        model.gap_m + jacobian.m21 * residual.x + jacobian.m22 * residual.y
    }

    /// What the encoders show of the contact.
    fn encoder_reading(&self, model: &Model, gap_m: f32) -> EncoderReading {
        let count = self.estimator.count_rad();
        // Half a count of either encoder; the second one turns θ2 alone.
        let rounding_m = 0.5 * (model.tip_m.x.abs() * count.x + model.jacobian.m22.abs() * count.y);
        // What the innovation settles at when the contact force is gone.
        let release = -self.estimator.lag_counts(&self.contact_acceleration);
        EncoderReading {
            gap_m,
            gap_error_m: self.configuration.settings.contact.gap_uncertainty_m
                + self.calibration.gap_error_m(rounding_m),
            moved: self.estimator.moved(),
            release: release.dot(&self.estimator.innovation_counts()),
            full_release: release.norm_squared(),
        }
    }

    /// The tip has just left the belt. Where a little more friction than estimated explains
    /// that, it is taken to be the reason.
    fn thrown(&mut self, model: &Model) {
        let friction = self.friction.estimate();
        let coupling = friction.slip.sign::<f32>() * model.q.m12;
        let critical = model.q.m22 / coupling;
        if coupling > 0.0 && critical < friction.coefficient + THROWN_BY_FRICTION {
            self.friction.thrown(critical);
        }
    }
}

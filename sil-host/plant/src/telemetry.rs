//! Internal state of the controller at its last tick, in SI units.

use painleve_firmware::estimate::Estimators;
use painleve_firmware::last_command::LastCommand;
use painleve_firmware::refer::Target;
use painleve_shared::frame::{ActuatorFrame, SensorFrame, StatusFlags};
use painleve_shared::{JointTorque, LinkMotion, Slip};

use crate::Controller;

/// A snapshot for logs and displays.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Telemetry {
    /// Estimated link angles θ1, θ2, rad.
    pub theta_rad: LinkMotion<f32>,
    /// Estimated rates of the link angles, rad/s.
    pub theta_dot_rad_s: LinkMotion<f32>,
    /// Estimated tip position z_t, m.
    pub tip_t_m: f32,
    /// Reference z_t*, m.
    pub reference_m: f32,
    /// Reference that the program requests, before an edge holds it back, m.
    pub requested_m: f32,
    /// Measured normal force, N.
    pub normal_force_n: f32,
    /// Measured tangential force, N.
    pub tangential_force_n: f32,
    /// Joint torques u1, u2 as output, rounded to counts, N·m.
    pub torque_nm: JointTorque<f32>,
    /// The contact decision: the tip touches the belt.
    pub contact: bool,
    /// Certainty of the contact decision, 0 … 1.
    pub contact_confidence: f32,
    /// Estimated friction coefficient.
    pub friction: f32,
    /// Standard deviation of the friction coefficient.
    pub friction_deviation: f32,
    /// Direction of slip.
    pub slip: Slip,
    /// Whether the tip is estimated to stick to the belt.
    pub sticks: bool,
    /// Lower and upper edge of the admissible stretch of the belt, m.
    pub edges_m: [f32; 2],
    /// Whether an edge holds the reference back.
    pub at_edge: bool,
    /// Whether the tip is being returned to the belt.
    pub recovering: bool,
    /// Whether the torque was limited.
    pub saturated: bool,
    /// Number of ticks since the start with limited torque.
    pub saturated_ticks: u32,
}

impl Telemetry {
    /// Runs a tick of the controller, and writes what it shows.
    pub fn tick(&mut self, controller: &mut Controller, frame: &SensorFrame) -> ActuatorFrame {
        controller.answer_and_show(frame, |estimates, target, command| {
            self.record(estimates, target, command);
        });
        controller.update();
        let answer = *controller.last_answer();
        // A tick without new readings shows nothing, but may take the torque off.
        if answer.torques.iter().all(|torque| torque.0 == 0) {
            self.torque_nm = JointTorque::zeros();
        }
        self.at_edge = answer.flags.contains(StatusFlags::AT_EDGE);
        self.recovering = answer.flags.contains(StatusFlags::RECOVERING);
        self.saturated = answer.flags.contains(StatusFlags::SATURATED);
        answer
    }

    fn record(&mut self, estimates: &Estimators, target: &Target, command: &LastCommand) {
        let (model, contact) = (&estimates.model, &estimates.contact);
        *self = Self {
            theta_rad: model.theta_rad,
            theta_dot_rad_s: model.theta_dot_rad_s,
            tip_t_m: model.tip_m.x,
            reference_m: target.reference.position_m,
            requested_m: target.requested_m,
            normal_force_n: contact.force_n.y,
            tangential_force_n: contact.force_n.x,
            torque_nm: command.torque_nm,
            contact: contact.touches,
            contact_confidence: estimates.detector.confidence(),
            friction: contact.friction.coefficient,
            friction_deviation: contact.friction.deviation(),
            slip: contact.friction.slip,
            sticks: contact.friction.sticks,
            edges_m: [target.stretch.lower_m, target.stretch.upper_m],
            saturated_ticks: self.saturated_ticks.wrapping_add(command.saturated.into()),
            ..Self::default()
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Configuration;
    use painleve_shared::counts::{EncoderCounts, ForceCounts};
    use painleve_shared::frame::DigitalInputs;
    use painleve_shared::status::SupervisorState;

    /// The tip rests on the belt, pressed by 10 N; more torque than is left would hold it.
    #[test]
    fn limited_torques_are_counted_and_a_tick_without_readings_may_take_them_off() {
        let mut configuration = Configuration::default();
        configuration.settings.torque_limit_nm = 0.05;
        let mut controller = Controller::new(&configuration).unwrap();
        let converters = configuration.converters;
        let [theta_1, theta_2] = [-11.4_f64, -35.1].map(f64::to_radians);
        let [encoder, _] = converters.encoders;
        let pressed = |tick| SensorFrame {
            tick,
            sequence: tick,
            joints: [theta_1, theta_2 - theta_1].map(|angle| encoder.reading(angle)),
            normal_force: ForceCounts(converters.force.counts(10.0).0),
            tangential_force: ForceCounts(converters.force.counts(-6.0).0),
            inputs: DigitalInputs::ENABLE,
        };
        let mut telemetry = Telemetry::default();
        for tick in 0..30 {
            telemetry.tick(&mut controller, &pressed(tick));
        }
        assert!(
            telemetry.saturated && telemetry.saturated_ticks > 10,
            "{telemetry:?}"
        );
        assert!(telemetry.torque_nm.amax() > 0.0);
        let missing = |tick| SensorFrame {
            joints: [EncoderCounts::MISSING; 2],
            ..pressed(tick)
        };
        let mut answer = ActuatorFrame::default();
        for tick in 30..100 {
            answer = telemetry.tick(&mut controller, &missing(tick));
        }
        assert_eq!(answer.supervisor_state(), Some(SupervisorState::Fault));
        assert_eq!(telemetry.torque_nm, JointTorque::zeros());
        assert!(!telemetry.saturated && !telemetry.at_edge && !telemetry.recovering);
    }
}

//! One control tick, from sensor counts to torque counts.

mod arrival;
mod drive;
mod observation;
#[cfg(test)]
mod tests;

use nalgebra::Vector2;
use painleve_shared::counts::{Micrometres, TorqueCounts};
use painleve_shared::frame::{ActuatorFrame, DigitalInputs, SensorFrame, StatusFlags};
use painleve_shared::range::OutOfRange;
use painleve_shared::status::{Fault, SupervisorState};
use painleve_shared::{Arm, Posture, Slip};

use self::arrival::Arrival;
use crate::configuration::Configuration;
use crate::estimate::belt::BeltObserver;
use crate::estimate::calibration::LengthCalibration;
use crate::estimate::contact::ContactObserver;
use crate::estimate::disturbance::DisturbanceObserver;
use crate::estimate::friction::FrictionEstimator;
use crate::estimate::joints::{EncoderJump, Estimator};
use crate::estimate::model::Model;
use crate::law::Law;
use crate::law::signals::LawInput;
use crate::recover::Recovery;
use crate::refer::governor::EdgeGovernor;
use crate::refer::reference::{QueueFull, ReferenceGenerator, Segment, TipReference};
use crate::supervise::deadline_monitor::DeadlineMonitor;
use crate::supervise::supervisor::Supervisor;
use crate::telemetry::Telemetry;

/// The controller: configuration and state of one arm.
#[derive(Clone, Debug)]
pub struct Controller {
    configuration: Configuration,
    arm: Arm<f32>,
    tick_s: f32,
    estimator: Estimator,
    contact: ContactObserver,
    friction: FrictionEstimator,
    belt: BeltObserver,
    disturbance: DisturbanceObserver,
    calibration: LengthCalibration,
    supervisor: Supervisor,
    monitor: DeadlineMonitor,
    reference: ReferenceGenerator,
    governor: EdgeGovernor,
    law: Law,
    recovery: Recovery,
    /// Posture in which the drive was armed or the tip landed.
    posture: Posture,
    /// θ̈ of q' expected until the next tick, rad/s².
    expected_acceleration: Vector2<f32>,
    /// What of it the contact force is expected to cause, rad/s².
    contact_acceleration: Vector2<f32>,
    /// Torque that rounding to counts still owes, N·m.
    rounding_nm: Vector2<f32>,
    last_sequence: Option<u32>,
    /// Ticks since the last readings that were taken in, before the present frame's.
    unread_ticks: u32,
    answer: ActuatorFrame,
    telemetry: Telemetry,
}

impl Controller {
    /// A controller that has seen no frame yet.
    ///
    /// # Errors
    /// [`OutOfRange`] naming the first key that is out of range.
    pub fn new(configuration: &Configuration) -> Result<Self, OutOfRange> {
        let arm = configuration.validate()?;
        Ok(Self {
            arm,
            tick_s: configuration.tick_s(),
            estimator: Estimator::new(
                &configuration.settings.estimator,
                configuration.converters.encoders,
                configuration.tick_hz,
            ),
            contact: ContactObserver::new(&configuration.settings.contact),
            friction: FrictionEstimator::new(
                &configuration.settings.friction,
                configuration.settings.contact.force_noise_n,
                configuration.tick_s(),
            ),
            belt: BeltObserver::new(&configuration.settings.belt),
            disturbance: DisturbanceObserver::new(
                &configuration.settings.disturbance,
                configuration.tick_s(),
            ),
            calibration: LengthCalibration::new(
                &configuration.settings.calibration,
                configuration.arm.link_length_m,
                configuration.arm.height_m,
                configuration.tick_s(),
            ),
            supervisor: Supervisor::new(configuration.settings.supervisor, configuration.tick_hz),
            monitor: DeadlineMonitor::new(configuration.settings.deadlines),
            reference: ReferenceGenerator::new(
                &configuration.settings.reference,
                0.0,
                configuration.tick_hz,
            ),
            governor: EdgeGovernor::new(
                &configuration.settings.governor,
                arm.reach_on_belt_m(),
                configuration.tick_s(),
                configuration.tip_count_m(),
            ),
            law: Law::new(&configuration.settings.law),
            recovery: Recovery::new(&configuration.settings.recovery),
            posture: Posture::ElbowDown,
            expected_acceleration: Vector2::zeros(),
            contact_acceleration: Vector2::zeros(),
            rounding_nm: Vector2::zeros(),
            last_sequence: None,
            unread_ticks: 0,
            answer: ActuatorFrame::default(),
            telemetry: Telemetry::default(),
            configuration: configuration.clone(),
        })
    }

    /// Appends a segment to the reference.
    ///
    /// # Errors
    /// [`QueueFull`]; the reference stays as it was.
    pub fn push_reference(&mut self, segment: Segment) -> Result<(), QueueFull> {
        self.reference.push(segment)
    }

    /// What went on inside at the last tick.
    pub fn telemetry(&self) -> &Telemetry {
        &self.telemetry
    }

    /// Answers one sensor frame.
    pub fn tick(&mut self, frame: &SensorFrame) -> ActuatorFrame {
        let sequence = self.answer.sequence.wrapping_add(1);
        match self.arrival(frame) {
            Arrival::After(ticks) => self.answer(frame, ticks),
            // There is nothing new to go by: the last torque stays, for a while.
            Arrival::Stale if self.supervisor.drives() => {}
            Arrival::OutOfRange
                if self.supervisor.drives() && frame.inputs.contains(DigitalInputs::ENABLE) => {}
            Arrival::OutOfRange if self.supervisor.drives() => {
                self.supervisor.disable();
                self.shut_down(frame.tick);
            }
            Arrival::Stale | Arrival::OutOfRange => self.shut_down(frame.tick),
        }
        self.answer.tick = frame.tick;
        self.answer.sequence = sequence;
        self.answer
    }

    fn answer(&mut self, frame: &SensorFrame, elapsed_ticks: u32) {
        let expected = &self.expected_acceleration;
        if let Err(EncoderJump) = self
            .estimator
            .update(&frame.joints, elapsed_ticks, expected)
        {
            self.supervisor.latch(Fault::EncoderJump);
        }
        let model = Model::new(
            &self.arm,
            self.estimator.theta_rad(),
            self.estimator.theta_dot_rad_s(),
            self.disturbance.disturbance_nm(),
        );
        let observed = self.observe(&model, frame, elapsed_ticks);
        let contact = observed.contact;
        let lands = contact && !observed.touched;
        let state_before = self.supervisor.state();
        self.supervisor
            .tick(frame.inputs, contact, self.law.is_on());
        let state = self.supervisor.state();
        let armed = state == SupervisorState::Armed && state_before != state;
        let recovering = self.supervisor.recovers() && self.contact.flight();

        let tip_t_m = model.tip_m.x;
        if armed {
            self.posture = Posture::of(&model.theta_rad);
        } else if let Some(posture) = self.recovery.posture() {
            self.posture = posture;
        }
        let tracks = state == SupervisorState::Tracking && state_before == SupervisorState::Armed;
        if armed || (lands && state == SupervisorState::Armed) {
            let program = &self.configuration.settings.reference;
            self.reference.restart(program, tip_t_m);
        }
        if tracks {
            // The tip has been dragged while friction was not known, and what it is
            // taken to be where has changed with the links' length.
            self.reference.start_from(tip_t_m);
        }
        let landing_p_ratio = if recovering {
            self.configuration.settings.recovery.minimum_p_ratio
        } else {
            0.0
        };
        self.governor.search(
            &self.arm,
            self.posture,
            tip_t_m,
            &observed.friction,
            landing_p_ratio,
        );
        let wanted = match state {
            SupervisorState::Armed => self.reference.start(),
            // A reference does not run away from a tip that is being brought back.
            SupervisorState::LiftOff if recovering => self.reference.present(),
            SupervisorState::Tracking | SupervisorState::LiftOff => self.reference.next_tick(),
            SupervisorState::Idle | SupervisorState::Fault => TipReference {
                position_m: tip_t_m,
                ..Default::default()
            },
        };
        let starts = armed || lands;
        if starts || tracks {
            self.governor.restart(tip_t_m);
        }
        let mut input = LawInput {
            arm: &self.arm,
            model: &model,
            posture: self.posture,
            force_n: observed.force_n,
            friction: observed.friction,
            p_per_kg: observed.p_per_kg,
            contact,
            saturated: (self.telemetry.saturated || self.telemetry.guarded) && !starts,
            reference: wanted,
            torque_limit_nm: self.configuration.settings.torque_limit_nm,
            tick_s: self.tick_s,
        };
        if state == SupervisorState::Armed
            || state == SupervisorState::Tracking
            || state == SupervisorState::LiftOff
        {
            input.reference = self.governor.govern(&wanted, self.tick_s);
        }

        self.telemetry = Telemetry {
            tick: frame.tick,
            theta_rad: model.theta_rad.into(),
            theta_dot_rad_s: model.theta_dot_rad_s.into(),
            tip_t_m,
            reference_m: input.reference.position_m,
            normal_force_n: observed.force_n.y,
            tangential_force_n: observed.force_n.x,
            contact,
            contact_confidence: self.contact.confidence(),
            friction: input.friction.coefficient,
            friction_deviation: input.friction.deviation,
            slip: input.friction.slip,
            sticks: input.friction.sticks,
            edges_m: self.governor.edges_m().into(),
            at_edge: self.governor.is_at_edge(),
            recovering,
            guarded: false,
            ..self.telemetry
        };
        if self.supervisor.drives() {
            let output = if recovering {
                self.recovery.tick(
                    &self.arm,
                    &model,
                    self.governor.fresh_edges_m(),
                    self.tick_s,
                )
            } else {
                self.recovery.end();
                if starts {
                    self.law.reset(&input);
                }
                self.law.tick(&input)
            };
            self.drive(&output, &model, &observed);
        }
        if self.supervisor.drives() {
            self.report(frame.tick);
        } else {
            self.shut_down(frame.tick);
        }
    }

    /// Torque off.
    fn shut_down(&mut self, tick: u32) {
        self.answer.torques = [TorqueCounts(0); 2];
        self.telemetry.torque_nm = [0.0; 2];
        self.telemetry.saturated = false;
        self.telemetry.guarded = false;
        self.telemetry.recovering = false;
        self.telemetry.at_edge = false;
        self.expected_acceleration = Vector2::zeros();
        self.contact_acceleration = Vector2::zeros();
        self.rounding_nm = Vector2::zeros();
        self.report(tick);
    }

    fn report(&mut self, tick: u32) {
        let telemetry = &mut self.telemetry;
        telemetry.tick = tick;
        telemetry.state = self.supervisor.state();
        telemetry.fault = self.supervisor.fault();
        let mut flags = StatusFlags::default();
        flags.set_if(StatusFlags::CONTACT, telemetry.contact);
        flags.set_if(StatusFlags::SATURATED, telemetry.saturated);
        flags.set_if(StatusFlags::REFERENCE_DONE, self.reference.is_done());
        flags.set_if(StatusFlags::GUARDED, telemetry.guarded);
        flags.set_if(StatusFlags::AT_EDGE, telemetry.at_edge);
        flags.set_if(StatusFlags::RECOVERING, telemetry.recovering);
        flags.set_if(
            StatusFlags::SLIP_NEGATIVE,
            telemetry.contact && telemetry.slip == Slip::Negative,
        );
        flags.set_if(StatusFlags::STICKS, telemetry.contact && telemetry.sticks);
        self.answer.reference_tip = Micrometres::from_metres(telemetry.reference_m);
        self.answer.estimated_tip = Micrometres::from_metres(telemetry.tip_t_m);
        self.answer.state = telemetry.state as u8;
        self.answer.fault = telemetry.fault.map_or(0, |fault| fault as u8);
        self.answer.flags = flags;
    }
}

//! One control tick, from sensor counts to torque counts.

use nalgebra::Vector2;
use painleve_shared::counts::{Micrometres, TorqueCounts};
use painleve_shared::frame::{ActuatorFrame, DigitalInputs, SensorFrame, StatusFlags};
use painleve_shared::range::OutOfRange;
use painleve_shared::status::{Fault, SupervisorState};
use painleve_shared::{Arm, Posture, Real, Slip};

use crate::belt_observer::BeltObserver;
use crate::configuration::Configuration;
use crate::contact_guard::{HalfPlane, nearest_torque_nm};
use crate::contact_observer::{ContactObserver, GapReading};
use crate::deadline_monitor::{DeadlineMonitor, Lapse};
use crate::disturbance_observer::DisturbanceObserver;
use crate::edge_governor::EdgeGovernor;
use crate::estimator::{EncoderJump, Estimator};
use crate::friction_estimator::FrictionEstimator;
use crate::law::Law;
use crate::law::signals::{LawInput, LawOutput};
use crate::length_calibration::LengthCalibration;
use crate::model::Model;
use crate::recovery::Recovery;
use crate::reference::{QueueFull, ReferenceGenerator, Segment, TipReference};
use crate::supervisor::Supervisor;
use crate::telemetry::Telemetry;

/// Friction above the estimate that a throw may be explained by.
const THROWN_BY_FRICTION: f32 = 0.4;

/// Ticks without readings are not counted further: a fault is latched long before.
const UNREAD_TICKS_LIMIT: u32 = 1 << 16;

/// What a frame is good for.
enum Arrival {
    /// Readings so many ticks after the ones before (1 when none were lost).
    After(u32),
    /// A repeated or old frame.
    Stale,
    /// A new frame with a reading that cannot be.
    OutOfRange,
}

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
    rate_before: Vector2<f32>,
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
                &configuration.estimator,
                configuration.converters.encoders,
                configuration.tick_hz,
            ),
            contact: ContactObserver::new(&configuration.contact),
            friction: FrictionEstimator::new(
                &configuration.friction,
                configuration.contact.force_noise_n,
                configuration.tick_s(),
            ),
            belt: BeltObserver::new(&configuration.belt),
            disturbance: DisturbanceObserver::new(&configuration.disturbance, configuration.tick_s()),
            rate_before: Vector2::zeros(),
            calibration: LengthCalibration::new(
                &configuration.calibration,
                configuration.arm.link_length_m,
                configuration.arm.height_m,
                configuration.tick_s(),
            ),
            supervisor: Supervisor::new(configuration.supervisor, configuration.tick_hz),
            monitor: DeadlineMonitor::new(configuration.deadlines),
            reference: ReferenceGenerator::new(
                &configuration.reference,
                0.0,
                configuration.tick_hz,
            ),
            governor: EdgeGovernor::new(&configuration.governor, arm.reach_on_belt_m()),
            law: Law::new(&configuration.law),
            recovery: Recovery::new(&configuration.recovery),
            posture: Posture::ElbowDown,
            expected_acceleration: Vector2::zeros(),
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

    /// Takes note of how many times something went wrong around this tick, 0 for a
    /// good one. If that is now too often in a row, the fault is latched, and the last answer
    /// without its torque is returned, to be put out at once.
    #[inline]
    pub fn note(&mut self, lapse: Lapse, times: u32) -> Option<ActuatorFrame> {
        // A good one, which nearly all are, costs next to nothing.
        if times == 0 {
            self.monitor.note_good(lapse);
            None
        } else {
            self.note_bad(lapse, times)
        }
    }

    #[cold]
    #[inline(never)]
    fn note_bad(&mut self, lapse: Lapse, times: u32) -> Option<ActuatorFrame> {
        if !self.monitor.note_bad(lapse, times) || self.supervisor.fault().is_some() {
            return None;
        }
        self.supervisor.latch(lapse.fault());
        self.shut_down(self.answer.tick);
        Some(self.answer)
    }

    /// How often each kind of lapse has happened.
    pub fn monitor(&self) -> &DeadlineMonitor {
        &self.monitor
    }

    fn arrival(&mut self, frame: &SensorFrame) -> Arrival {
        let last = self.last_sequence.unwrap_or(frame.sequence.wrapping_sub(1));
        let ahead = frame.sequence.wrapping_sub(last);
        let converters = &self.configuration.converters;
        let mut joints = converters.encoders.iter().zip(frame.joints);
        let forces = [frame.normal_force, frame.tangential_force];
        let encoders = joints.all(|(scale, reading)| scale.contains(reading));
        let forces = forces
            .iter()
            .all(|force| converters.force.contains(force.0));
        if ahead != 1 || !encoders || !forces {
            return self.irregular_arrival(frame.sequence, ahead, encoders, forces);
        }
        self.last_sequence = Some(frame.sequence);
        for lapse in Lapse::OF_FRAMES {
            self.note(lapse, 0);
        }
        Arrival::After(1 + core::mem::take(&mut self.unread_ticks))
    }

    /// A frame that is not the next one, or has readings (`encoders`, `forces`) out of range.
    #[cold]
    #[inline(never)]
    fn irregular_arrival(
        &mut self,
        sequence: u32,
        ahead: u32,
        encoders: bool,
        forces: bool,
    ) -> Arrival {
        // More than half the range ahead is behind.
        let stale = ahead == 0 || ahead > u32::MAX / 2;
        self.note(Lapse::StaleFrame, u32::from(stale));
        if stale {
            return Arrival::Stale;
        }
        self.last_sequence = Some(sequence);
        self.note(Lapse::LostFrame, ahead - 1);
        self.note(Lapse::EncoderOutOfRange, u32::from(!encoders));
        self.note(Lapse::ForceOutOfRange, u32::from(!forces));
        let ticks = ahead.saturating_add(self.unread_ticks);
        if encoders && forces {
            self.unread_ticks = 0;
            Arrival::After(ticks)
        } else {
            self.unread_ticks = ticks.min(UNREAD_TICKS_LIMIT);
            Arrival::OutOfRange
        }
    }

    fn answer(&mut self, frame: &SensorFrame, elapsed_ticks: u32) {
        let expected = &self.expected_acceleration;
        if let Err(EncoderJump) = self
            .estimator
            .update(&frame.joints, elapsed_ticks, expected)
        {
            self.supervisor.latch(Fault::EncoderJump);
        }
        let scale = self.configuration.converters.force;
        let force_n = Vector2::new(
            scale.value(frame.tangential_force.0),
            scale.value(frame.normal_force.0),
        );
        let model = Model::new(
            &self.arm,
            self.estimator.theta_rad(),
            self.estimator.theta_dot_rad_s(),
            self.disturbance.torque_nm(),
        );
        let touched = self.contact.contact();
        // At the end of its range the force cell shows less than there is.
        let range = scale.maximum_counts();
        let in_range = [frame.tangential_force, frame.normal_force]
            .iter()
            .all(|force| force.0.abs() < range);
        let contact = self.observe(&model, &force_n, in_range);
        if self.supervisor.drives() && self.contact.confidence() >= 1.0 {
            let acceleration = (model.theta_dot_rad_s - self.rate_before) / (self.tick_s * elapsed_ticks as f32);
            let friction = self.friction.estimate();
            let p_ratio = if contact { model.p_per_kg(friction.coefficient, friction.slip) / model.q.m22 } else { 1.0 };
            let needed = model.inverse_dynamics_nm(&acceleration, &force_n);
            let given = Vector2::from(self.telemetry.torque_nm);
            let residual = painleve_shared::dynamics::generalised_torque_nm(&(needed - given));
            self.disturbance.update(&residual, p_ratio);
        }
        self.rate_before = model.theta_dot_rad_s;
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
        if armed || (contact && !touched && state == SupervisorState::Armed) {
            let program = &self.configuration.reference;
            self.reference.restart(program, tip_t_m);
        }
        let landing_p_ratio = if recovering {
            self.configuration.recovery.minimum_p_ratio
        } else {
            0.0
        };
        self.governor.search(
            &self.arm,
            self.posture,
            tip_t_m,
            &self.friction.estimate(),
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
        let starts = armed || (contact && !touched);
        if starts {
            self.governor.restart(tip_t_m);
        }
        let mut input = LawInput {
            arm: &self.arm,
            model: &model,
            posture: self.posture,
            force_n,
            friction: self.friction.estimate(),
            contact,
            saturated: (self.telemetry.saturated || self.telemetry.guarded) && !starts,
            reference: wanted,
            torque_limit_nm: self.configuration.torque_limit_nm,
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
            normal_force_n: force_n.y,
            tangential_force_n: force_n.x,
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
            self.drive(&output, &model, contact);
        }
        if self.supervisor.drives() {
            self.report(frame.tick);
        } else {
            self.shut_down(frame.tick);
        }
    }

    /// Takes in what a tick's readings say about contact, friction, belt and links; returns
    /// whether the tip touches.
    fn observe(&mut self, model: &Model, force_n: &Vector2<f32>, in_range: bool) -> bool {
        let residual = self.estimator.residual_rad();
        let innovation = self.estimator.innovation_rad();
        let jacobian = &model.jacobian;
        let count = self.estimator.count_rad();
        // Half a count of either encoder; the second one turns θ2 alone.
        let gap_error_m = 0.5 * (model.tip_m.x.abs() * count.x + jacobian.m22.abs() * count.y);
        let jump_error_m =
            0.5 * ((jacobian.m11 + jacobian.m12).abs() * count.x + jacobian.m12.abs() * count.y);
        let gap = GapReading {
            gap_m: model.gap_m + jacobian.m21 * residual.x + jacobian.m22 * residual.y,
            gap_error_m,
            jump_m: jacobian.m11 * innovation.x + jacobian.m12 * innovation.y,
            jump_error_m,
        };
        let touched = self.contact.contact();
        let contact = self.contact.update(force_n.y, &gap);
        if contact {
            if !touched && let Some(slip) = self.belt.slip(model.tip_velocity_m_s.x) {
                self.friction.expect_slip(slip);
            }
            if in_range {
                self.friction.update(force_n);
            }
            if self.contact.confidence() >= 1.0 {
                let length = self.calibration.update(gap.gap_m);
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
        contact
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

    /// Turns a law's answer into counts: kept on the belt, limited, checked.
    fn drive(&mut self, output: &LawOutput, model: &Model, contact: bool) {
        let mut torque_nm = output.torque_nm;
        let guard = self.configuration.guard;
        if guard.enabled && contact {
            let friction = self.friction.estimate();
            let p = model.p_per_kg(friction.coefficient, friction.slip);
            if p > 0.0 && friction.slip_seen {
                let (offset, normal) = model.free_normal_acceleration();
                let plane = HalfPlane {
                    normal,
                    bound: -p * guard.minimum_force_n - offset,
                };
                let limit = self.configuration.torque_limit_nm;
                let (guarded_nm, acted) = nearest_torque_nm(&torque_nm, &plane, limit);
                if acted {
                    torque_nm = guarded_nm;
                    self.telemetry.guarded = true;
                    self.telemetry.guarded_ticks = self.telemetry.guarded_ticks.wrapping_add(1);
                }
            }
        }
        self.apply(&torque_nm);
        let given_nm = Vector2::from(self.telemetry.torque_nm);
        let acceleration = model.acceleration_rad_s2(&given_nm, &output.contact_force_n);
        self.expected_acceleration = Vector2::new(acceleration.x, acceleration.y - acceleration.x);
    }

    /// Limits the wanted torques and turns them into counts.
    fn apply(&mut self, wanted_nm: &Vector2<f32>) {
        // Before clamping, which would turn an infinity into a limit.
        if !(wanted_nm.x.is_finite() && wanted_nm.y.is_finite()) {
            self.supervisor.latch(Fault::NotFinite);
            return;
        }
        let limit = self.configuration.torque_limit_nm;
        let scale = self.configuration.converters.torque;
        let limited = wanted_nm.map(|torque| torque.limited(-limit, limit));
        // What rounding took away is given with the next tick: near the edge, where p is
        // small, half a count of constant torque would be a newton of force.
        let owed = (limited + self.rounding_nm).map(|torque| torque.limited(-limit, limit));
        let (counts_1, over_1) = scale.counts(owed.x);
        let (counts_2, over_2) = scale.counts(owed.y);
        let given = Vector2::new(scale.value(counts_1), scale.value(counts_2));
        let half = 0.5 * scale.per_count();
        self.rounding_nm = (owed - given).map(|rest| rest.limited(-half, half));
        let saturated = over_1 || over_2 || limited != *wanted_nm;
        self.answer.torques = [TorqueCounts(counts_1), TorqueCounts(counts_2)];
        self.telemetry.torque_nm = limited.into();
        self.telemetry.saturated = saturated;
        if saturated {
            self.telemetry.saturated_ticks = self.telemetry.saturated_ticks.wrapping_add(1);
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

#[cfg(test)]
mod tests;

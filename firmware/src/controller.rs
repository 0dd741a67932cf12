//! One control tick, from sensor counts to torque counts.

use nalgebra::Vector2;
use painleve_shared::counts::{Micrometres, TorqueCounts};
use painleve_shared::frame::{ActuatorFrame, DigitalInputs, SensorFrame, StatusFlags};
use painleve_shared::range::OutOfRange;
use painleve_shared::status::{Fault, SupervisorState};
use painleve_shared::{Arm, Pose, Posture, Real};

use crate::configuration::Configuration;
use crate::contact_detector::ContactDetector;
use crate::deadline_monitor::{DeadlineMonitor, Lapse};
use crate::estimator::{EncoderJump, Estimator};
use crate::law::Law;
use crate::law::signals::LawInput;
use crate::reference::{QueueFull, ReferenceGenerator, Segment, TipReference};
use crate::supervisor::Supervisor;
use crate::telemetry::Telemetry;

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
    detector: ContactDetector,
    supervisor: Supervisor,
    monitor: DeadlineMonitor,
    reference: ReferenceGenerator,
    law: Law,
    posture: Posture,
    /// θ̈ of q' that the law expects until the next tick, rad/s².
    expected_acceleration: Vector2<f32>,
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
            detector: ContactDetector::new(configuration.contact),
            supervisor: Supervisor::new(configuration.supervisor),
            monitor: DeadlineMonitor::new(configuration.deadlines),
            reference: ReferenceGenerator::new(
                &configuration.reference,
                0.0,
                configuration.tick_hz,
            ),
            law: Law::new(&configuration.law),
            posture: Posture::ElbowDown,
            expected_acceleration: Vector2::zeros(),
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
        let contact = self.detector.update(force_n.y);
        let state_before = self.supervisor.state();
        self.supervisor
            .tick(frame.inputs, contact, self.law.is_on());

        let theta_rad = self.estimator.theta_rad();
        let theta_dot_rad_s = self.estimator.theta_dot_rad_s();
        let pose = Pose::new(&theta_rad);
        let tip_t_m = self.arm.tip_m(&pose).x;
        let mut input = LawInput {
            arm: &self.arm,
            theta_rad,
            theta_dot_rad_s,
            pose,
            posture: self.posture,
            force_n,
            contact,
            saturated: self.telemetry.saturated,
            reference: TipReference {
                position_m: tip_t_m,
                ..Default::default()
            },
            tick_s: self.tick_s,
        };
        let state = self.supervisor.state();
        if state == SupervisorState::Armed && state_before != state {
            self.posture = Posture::of(&theta_rad);
            input.posture = self.posture;
            self.reference = ReferenceGenerator::new(
                &self.configuration.reference,
                tip_t_m,
                self.configuration.tick_hz,
            );
            input.saturated = false;
            self.law.reset(&input);
        }
        input.reference = match state {
            SupervisorState::Armed => self.reference.start(),
            SupervisorState::Tracking | SupervisorState::LiftOff => self.reference.next_tick(),
            SupervisorState::Idle | SupervisorState::Fault => input.reference,
        };

        self.telemetry = Telemetry {
            tick: frame.tick,
            theta_rad: theta_rad.into(),
            theta_dot_rad_s: theta_dot_rad_s.into(),
            tip_t_m,
            reference_m: input.reference.position_m,
            normal_force_n: force_n.y,
            tangential_force_n: force_n.x,
            contact,
            ..self.telemetry
        };
        if self.supervisor.drives() {
            let output = self.law.tick(&input);
            let acceleration = output.acceleration_rad_s2;
            self.expected_acceleration =
                Vector2::new(acceleration.x, acceleration.y - acceleration.x);
            self.apply(&output.torque_nm);
        }
        if self.supervisor.drives() {
            self.report(frame.tick);
        } else {
            self.shut_down(frame.tick);
        }
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
        let (counts_1, over_1) = scale.counts(limited.x);
        let (counts_2, over_2) = scale.counts(limited.y);
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
        self.expected_acceleration = Vector2::zeros();
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
        self.answer.reference_tip = Micrometres::from_metres(telemetry.reference_m);
        self.answer.estimated_tip = Micrometres::from_metres(telemetry.tip_t_m);
        self.answer.state = telemetry.state as u8;
        self.answer.fault = telemetry.fault.map_or(0, |fault| fault as u8);
        self.answer.flags = flags;
    }
}

#[cfg(test)]
mod tests;

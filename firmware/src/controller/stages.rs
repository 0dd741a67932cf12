//! The stages of a tick, from readings to an answer, and what they learn after it.

use painleve_shared::counts::Micrometres;
use painleve_shared::frame::{ActuatorFrame, SensorFrame, StatusFlags};
use painleve_shared::status::Fault;
use painleve_shared::{Arm, Slip};

use super::arrival::ArrivalState;
use crate::configuration::Configuration;
use crate::demand::TorqueDemand;
use crate::estimate::belt::BeltEstimator;
use crate::estimate::calibration::LengthCalibrator;
use crate::estimate::contact::ContactDetector;
use crate::estimate::disturbance::DisturbanceEstimator;
use crate::estimate::friction::{FrictionEstimate, FrictionEstimator};
use crate::estimate::joint_friction::JointFriction;
use crate::estimate::joints::{JointEstimator, JointEstimatorSettings, Restart};
use crate::estimate::model::Model;
use crate::estimate::response::ResponseEstimator;
use crate::estimate::{ContactEstimate, Estimators, Observed};
use crate::last_command::LastCommand;
use crate::law::Law;
use crate::refer::References;
use crate::refer::governor::EdgeGovernor;
use crate::refer::reference::ReferenceGenerator;
use crate::schedule::Turn;
use crate::supervise::supervisor::Supervisor;
use crate::telemetry::Telemetry;
use crate::torque_output::TorqueOutput;

/// The stages of a tick, each with its settings, and their state between ticks.
#[derive(Clone, Debug)]
#[repr(C)]
pub struct Stages<L: Law> {
    command: LastCommand,
    demand: TorqueDemand<L>,
    torques: TorqueOutput,
    /// What is known of arm, contact and belt.
    pub estimates: Estimators,
    references: References,
    /// Whether the arm is driven, and the latched fault.
    pub supervisor: Supervisor,
    /// The tick that has been answered, for its update.
    observed: Observed,
    turn: Turn,
    /// What has arrived.
    pub arrivals: ArrivalState,
}

impl<L: Law> Stages<L> {
    /// Makes the stages, each with its own settings, without readings of this arm.
    pub fn new(configuration: &Configuration<L>, arm: Arm<f32>) -> Self {
        let (converters, settings) = (&configuration.converters, &configuration.settings);
        let speed = configuration.loop_speed(&arm);
        let joints = JointEstimatorSettings {
            bandwidth_rad_s: speed * settings.estimator.bandwidth_rad_s,
            ..settings.estimator
        };
        let (tick_hz, tick_s) = (configuration.tick_hz, configuration.tick_s());
        let torque_limit_nm = settings.torque_limit_nm;
        let torques = TorqueOutput::new(converters.torque, torque_limit_nm);
        let force_cell = converters.force.converter();
        let estimates = Estimators {
            contact: ContactEstimate {
                friction: FrictionEstimate::first(&settings.friction),
                ..ContactEstimate::default()
            },
            model: Model::default(),
            arm,
            joints: JointEstimator::new(&joints, converters.encoders, tick_hz),
            detector: ContactDetector::new(&settings.contact),
            friction_filter: FrictionEstimator::new(&settings.friction, &settings.contact, tick_s),
            belt: BeltEstimator::new(&settings.belt, tick_s),
            response: ResponseEstimator::new(&settings.response, tick_s),
            disturbance: DisturbanceEstimator::new(&settings.disturbance, torque_limit_nm, tick_s),
            calibrator: LengthCalibrator::new(&settings.calibration, &arm, Turn::COUNT * tick_s),
            joint_friction: JointFriction::new(configuration.arm.coulomb_friction_nm),
            force_cell,
            force_range_n: force_cell.value(force_cell.maximum_counts),
        };
        Self {
            estimates,
            command: LastCommand::default(),
            demand: TorqueDemand::new(configuration, speed, torques.limit_nm()),
            supervisor: Supervisor::new(settings.supervisor, settings.lapses, tick_hz),
            references: References::new(
                EdgeGovernor::new(
                    &settings.governor,
                    tick_s,
                    configuration.kept_distance_m(),
                    arm.reach_on_belt_m(),
                ),
                ReferenceGenerator::new(&settings.reference, tick_hz),
                settings.recovery.minimum_p_ratio,
            ),
            observed: Observed::default(),
            turn: Turn::default(),
            arrivals: ArrivalState::default(),
            torques,
        }
    }

    /// Answers a frame's readings, `elapsed_ticks` after the previous ones.
    ///
    /// # Errors
    /// [`Restart`] if the estimates have started from these readings, which then show nothing else.
    #[inline]
    pub fn answer(
        &mut self,
        frame: &SensorFrame,
        elapsed_ticks: u32,
        answer: &mut ActuatorFrame,
        telemetry: Option<&mut Telemetry>,
    ) -> Result<(), Restart> {
        let followed = self.estimates.observe(frame, elapsed_ticks, &self.command);
        if followed == Err(Restart::EncoderJump) {
            self.supervisor.latch(Fault::EncoderJump);
        }
        let contact = &self.estimates.contact;
        let phase = self
            .supervisor
            .tick(frame.inputs, contact.touches, self.demand.is_on());
        let landing = self.demand.flight.map(|flight| flight.posture);
        let target = self.references.tick(&self.estimates, &phase, landing);
        self.observed.elapsed_ticks = elapsed_ticks;
        if phase.state.drives() {
            let output = self
                .demand
                .tick(&self.estimates, &phase, &target, self.command.saturated);
            let torques = self.torques.tick(&mut self.command, &output);
            self.command.reference_velocity_m_s = target.reference.velocity_m_s;
            if let Err(fault) = torques {
                self.supervisor.latch(fault);
                self.release();
            }
        } else {
            self.release();
        }
        let (estimates, command) = (&self.estimates, &self.command);
        answer.torques = command.counts;
        answer.reference_tip = Micrometres::from_metres(target.reference.position_m);
        answer.estimated_tip = Micrometres::from_metres(estimates.model.tip_m.x);
        let (touches, friction) = (estimates.contact.touches, &estimates.contact.friction);
        let recovers = target.recovering && self.supervisor.drives();
        let slips = touches && friction.slip == Slip::Negative;
        let mut flags = StatusFlags::default();
        flags.set(StatusFlags::CONTACT, touches);
        flags.set(StatusFlags::SATURATED, command.saturated);
        flags.set(StatusFlags::REFERENCE_DONE, self.references.is_done());
        flags.set(StatusFlags::AT_EDGE, target.at_edge);
        flags.set(StatusFlags::RECOVERING, recovers);
        flags.set(StatusFlags::SLIP_NEGATIVE, slips);
        flags.set(StatusFlags::STICKS, touches && friction.sticks);
        answer.flags = flags;
        report(answer, &self.supervisor);
        if let Some(telemetry) = telemetry {
            telemetry.record(estimates, &target, command, &self.supervisor);
        }
        followed
    }

    /// Updates the estimates with the tick that has been answered, and the slow ones and the edges in turn.
    #[inline(never)]
    pub fn learn(&mut self) {
        let turn = self.turn.take();
        let (estimates, observed) = (&mut self.estimates, &self.observed);
        let touches = estimates.contact.touches;
        if touches {
            estimates.learn_in_contact(observed, turn);
        } else {
            estimates.learn_in_the_air(observed, turn);
        }
        // A tip that is being returned to the belt needs the edges soon.
        if turn == Turn::Edges || (!touches && self.references.asks_for_landing) {
            self.references.search(estimates);
        }
    }

    /// Prepares the estimates for the next readings.
    #[inline]
    pub fn prepare(&mut self) {
        let drives = self.supervisor.drives();
        self.estimates.prepare(&mut self.command, drives);
        self.references.prepare(self.supervisor.state());
        self.observed.drove = drives;
        self.observed.torque_nm = self.command.torque_nm;
        self.observed.rounding_nm = self.command.rounding_nm;
        self.observed.saturated = self.command.saturated;
    }

    /// Takes the torque off and cancels a recovery in progress.
    pub fn release(&mut self) {
        self.command = LastCommand::default();
        self.demand.flight = None;
        self.observed.drove = false;
    }
}

/// Returns state and fault of an answer.
pub fn report(answer: &mut ActuatorFrame, supervisor: &Supervisor) {
    answer.state = supervisor.state() as u8;
    answer.fault = supervisor.fault().map_or(0, |fault| fault as u8);
}

//! The stages of a tick, from readings to an answer, and what they learn after it.

use painleve_shared::counts::Micrometres;
use painleve_shared::frame::{ActuatorFrame, StatusFlags};
use painleve_shared::status::Fault;
use painleve_shared::{Arm, Slip};

use super::arrival::{ArrivalState, ReadingRanges};
use crate::configuration::Configuration;
use crate::demand::{DemandInput, DemandState, TorqueDemand};
use crate::estimate::joint_friction::{JointFriction, JointFrictionState};
use crate::estimate::joints::Restart;
use crate::estimate::{EstimateSettings, EstimatesState, Estimators, Observed, Readings};
use crate::last_command::LastCommand;
use crate::law::Law;
use crate::refer::{References, ReferencesState};
use crate::schedule::Turn;
use crate::supervise::supervisor::{Supervision, Supervisor};
use crate::telemetry::{TelemetrySink, TelemetryTick};
use crate::torque_output::{NotFinite, TorqueOutput};

/// What the update needs of the tick that has been answered, besides the state of the stages.
#[derive(Clone, Copy, Debug, Default)]
struct Answered {
    elapsed_ticks: u32,
    /// Whether torque was applied before the tick.
    drove: bool,
    /// Least p, as a fraction of Q22, at which the tip may land; 0 if it is not being returned to the belt.
    landing_p_ratio: f32,
}

/// The stages of a tick: settings only.
#[derive(Clone, Debug)]
#[repr(C)]
pub struct Stages<L> {
    estimators: Estimators,
    torques: TorqueOutput,
    joint_friction: JointFriction,
    supervisor: Supervisor,
    demand: TorqueDemand<L>,
    references: References,
    /// Ranges of the readings.
    pub ranges: ReadingRanges,
}

/// State of the stages between ticks.
#[derive(Clone, Debug)]
#[repr(C)]
pub struct State<L: Law> {
    estimates: EstimatesState,
    command: LastCommand,
    /// The command before that.
    before: LastCommand,
    demand: DemandState<L>,
    /// Whether the arm is driven, and the latched fault.
    pub supervision: Supervision,
    references: ReferencesState,
    answered: Answered,
    turn: Turn,
    /// What has arrived.
    pub arrivals: ArrivalState,
    joint_friction: JointFrictionState,
}

impl<L: Law> Stages<L> {
    /// Makes the stages, each with its own settings.
    pub fn new(configuration: &Configuration<L>, arm: &Arm<f32>) -> Self {
        let Configuration {
            tick_hz,
            arm: parameters,
            converters,
            settings,
        } = configuration;
        let speed = configuration.loop_speed(arm);
        Self {
            estimators: Estimators::new(&EstimateSettings {
                tick_hz: *tick_hz,
                tracking_speed: speed,
                encoders: converters.encoders,
                force: converters.force,
                torque_limit_nm: settings.torque_limit_nm,
                link_length_m: parameters.link_length_m[0],
                joints: &settings.estimator,
                contact: &settings.contact,
                friction: &settings.friction,
                belt: &settings.belt,
                response: &settings.response,
                disturbance: &settings.disturbance,
                calibration: &settings.calibration,
            }),
            supervisor: Supervisor::new(settings.supervisor, *tick_hz),
            references: References::new(
                &settings.reference,
                &settings.governor,
                *tick_hz,
                &configuration.joint_errors(),
                settings.recovery.minimum_p_ratio,
            ),
            demand: TorqueDemand::new(
                settings.law.sped_up(speed),
                &settings.recovery,
                configuration.tick_s(),
                settings.torque_limit_nm,
            ),
            torques: TorqueOutput::new(converters.torque, settings.torque_limit_nm),
            joint_friction: JointFriction::new(parameters.coulomb_friction_nm),
            ranges: ReadingRanges::of(converters),
        }
    }

    /// Starts without readings of this arm.
    pub fn start(&self, arm: Arm<f32>) -> State<L> {
        State {
            arrivals: ArrivalState::default(),
            estimates: self.estimators.start(arm),
            supervision: Supervision::default(),
            references: self.references.start(&arm),
            demand: self.demand.start(),
            command: LastCommand::default(),
            before: LastCommand::default(),
            answered: Answered::default(),
            turn: Turn::default(),
            joint_friction: JointFrictionState::default(),
        }
    }

    /// Answers readings.
    ///
    /// # Errors
    /// [`Restart`] if the estimates have started from these readings, which then show nothing else.
    #[inline]
    pub fn answer(
        &self,
        state: &mut State<L>,
        readings: &Readings<'_>,
        answer: &mut ActuatorFrame,
        telemetry: TelemetrySink<'_>,
    ) -> Result<(), Restart> {
        let followed = self.estimators.observe(
            &mut state.estimates,
            readings,
            &state.command,
            &self.joint_friction,
            &mut state.joint_friction,
        );
        if followed == Err(Restart::EncoderJump) {
            state.supervision.latch(Fault::EncoderJump);
        }
        let (model, contact) = (&state.estimates.model, &state.estimates.contact);
        state.answered.drove = state.supervision.drives();
        let phase = self.supervisor.tick(
            &mut state.supervision,
            readings.frame.inputs,
            contact.touches,
            self.demand.is_on(),
        );
        let references = &mut state.references;
        let landing = state.demand.landing_posture();
        let beginning = self
            .references
            .begin(references, model, contact, &phase, landing);
        state.answered.elapsed_ticks = readings.elapsed_ticks;
        state.answered.landing_p_ratio = beginning.landing_p_ratio;
        let target = self.references.tick(references, &beginning, model, &phase);
        if phase.drives() {
            let input = DemandInput {
                arm: &state.estimates.arm,
                model,
                contact,
                phase: &phase,
                target: &target,
                last: &state.command,
            };
            let output = self.demand.tick(&mut state.demand, &input);
            let torques = self.torques.tick(&mut state.command, &output);
            state.command.reference_velocity_m_s = target.reference.velocity_m_s;
            if let Err(NotFinite) = torques {
                state.supervision.latch(Fault::NotFinite);
                state.release();
            }
        } else {
            state.release();
        }
        let (model, contact) = (&state.estimates.model, &state.estimates.contact);
        let tick = TelemetryTick {
            model,
            contact,
            contact_confidence: state.estimates.contact_confidence(),
            target: &target,
            command: &state.command,
            recovering: target.recovering && state.supervision.drives(),
        };
        answer.torques = state.command.counts;
        answer.reference_tip = Micrometres::from_metres(target.reference.position_m);
        answer.estimated_tip = Micrometres::from_metres(model.tip_m.x);
        answer.flags = flags(&tick, self.references.is_done(&state.references));
        report(answer, &state.supervision);
        telemetry.record(&tick, readings.frame.tick, &state.supervision);
        followed
    }

    /// Updates the estimates with the tick that has been answered, and the slow ones and the edges in turn.
    ///
    /// Contact and flight have branches of their own: each excludes the other's work, as the bound on the update's
    /// cycles can see.
    // Out of line, because the bound leaves it out of a tick that has started the estimates.
    #[inline(never)]
    pub fn learn(&self, state: &mut State<L>) {
        let turn = state.turn.take();
        let (estimates, last, answered) = (&mut state.estimates, &state.before, &state.answered);
        let observed = Observed {
            elapsed_ticks: answered.elapsed_ticks,
            drove: answered.drove,
            last,
        };
        let estimators = &self.estimators;
        if estimates.contact.touches {
            let slow = estimators.learn_in_contact(estimates, &observed);
            match turn {
                Turn::Balance => {
                    estimators.balance_torques(estimates);
                    estimators.calibrate(estimates, &slow);
                }
                Turn::Edges => {
                    if !estimators.evaluate_response(estimates, &slow) {
                        self.search(state);
                    }
                }
            }
        } else {
            estimators.learn_in_the_air(estimates, &observed);
            if turn == Turn::Balance {
                estimators.balance_torques(estimates);
            }
            // A tip that is being returned to the belt needs the edges soon.
            if turn == Turn::Edges || answered.landing_p_ratio > 0.0 {
                self.search(state);
            }
        }
    }

    /// Continues the search for the edges.
    #[inline]
    fn search(&self, state: &mut State<L>) {
        let contact = &state.estimates.contact;
        self.references.search(
            &mut state.references,
            &state.estimates.arm,
            state.estimates.model.tip_m.x,
            contact.friction,
            state.answered.landing_p_ratio,
        );
    }

    /// Prepares the estimates for the next readings.
    #[inline]
    pub fn prepare(&self, state: &mut State<L>) {
        let drives = state.supervision.drives();
        self.estimators.prepare(
            &mut state.estimates,
            &mut state.command,
            drives,
            &state.joint_friction,
        );
        self.references
            .prepare(&mut state.references, state.supervision.state());
        state.before = state.command;
    }
}

impl<L: Law> State<L> {
    /// Takes the torque off and cancels a recovery in progress.
    pub fn release(&mut self) {
        self.command = LastCommand::default();
        self.demand.cancel_recovery();
    }
}

/// Returns state and fault of an answer.
pub fn report(answer: &mut ActuatorFrame, supervision: &Supervision) {
    answer.state = supervision.state() as u8;
    answer.fault = supervision.fault().map_or(0, |fault| fault as u8);
}

/// Returns the answer's flags for one tick.
fn flags(tick: &TelemetryTick<'_>, reference_done: bool) -> StatusFlags {
    let TelemetryTick {
        contact,
        target,
        command,
        recovering,
        ..
    } = tick;
    let friction = &contact.friction;
    let mut flags = StatusFlags::default();
    flags.set(StatusFlags::CONTACT, contact.touches);
    flags.set(StatusFlags::SATURATED, command.saturated);
    flags.set(StatusFlags::REFERENCE_DONE, reference_done);
    flags.set(StatusFlags::AT_EDGE, target.at_edge);
    flags.set(StatusFlags::RECOVERING, *recovering);
    flags.set(
        StatusFlags::SLIP_NEGATIVE,
        contact.touches && friction.slip == Slip::Negative,
    );
    flags.set(StatusFlags::STICKS, contact.touches && friction.sticks);
    flags
}

//! The stages of a tick, from readings to an answer, and what they learn after it.

use painleve_shared::counts::Micrometres;
use painleve_shared::frame::{ActuatorFrame, SensorFrame, StatusFlags};
use painleve_shared::status::Fault;
use painleve_shared::{Arm, Slip};

use super::arrival::{ArrivalState, ReadingRanges};
use crate::configuration::Configuration;
use crate::demand::{DemandState, TorqueDemand};
use crate::estimate::joints::Restart;
use crate::estimate::{ContactEstimate, EstimatesState, Estimators, Observed};
use crate::last_command::LastCommand;
use crate::law::Law;
use crate::refer::{References, ReferencesState, Target};
use crate::schedule::Turn;
use crate::supervise::supervisor::{Supervision, Supervisor};
use crate::telemetry::Telemetry;
use crate::torque_output::TorqueOutput;

/// The stages of a tick: settings only.
#[derive(Clone, Debug)]
#[repr(C)]
pub struct Stages<L> {
    estimators: Estimators,
    torques: TorqueOutput,
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
    demand: DemandState<L>,
    /// Whether the arm is driven, and the latched fault.
    pub supervision: Supervision,
    references: ReferencesState,
    /// The tick that has been answered, for its update.
    observed: Observed,
    /// Least p, as a fraction of Q22, at which the tip may land; 0 if it is not being returned to the belt.
    landing_p_ratio: f32,
    turn: Turn,
    /// What has arrived.
    pub arrivals: ArrivalState,
}

impl<L: Law> Stages<L> {
    /// Makes the stages, each with its own settings.
    pub fn new(configuration: &Configuration<L>, arm: &Arm<f32>) -> Self {
        let (converters, settings) = (&configuration.converters, &configuration.settings);
        let speed = configuration.loop_speed(arm);
        Self {
            estimators: Estimators::new(configuration, speed),
            supervisor: Supervisor::new(settings.supervisor, configuration.tick_hz),
            references: References::new(configuration),
            demand: TorqueDemand::new(configuration, speed),
            torques: TorqueOutput::new(converters.torque, settings.torque_limit_nm),
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
            observed: Observed::default(),
            landing_p_ratio: 0.0,
            turn: Turn::default(),
        }
    }

    /// Answers a frame's readings, `elapsed_ticks` after the previous ones.
    ///
    /// # Errors
    /// [`Restart`] if the estimates have started from these readings, which then show nothing else.
    #[inline]
    pub fn answer(
        &self,
        state: &mut State<L>,
        frame: &SensorFrame,
        elapsed_ticks: u32,
        answer: &mut ActuatorFrame,
        telemetry: Option<&mut Telemetry>,
    ) -> Result<(), Restart> {
        let followed =
            self.estimators
                .observe(&mut state.estimates, frame, elapsed_ticks, &state.command);
        if followed == Err(Restart::EncoderJump) {
            state.supervision.latch(Fault::EncoderJump);
        }
        let (model, contact) = (&state.estimates.model, &state.estimates.contact);
        state.observed.drove = state.supervision.drives();
        let phase = self.supervisor.tick(
            &mut state.supervision,
            frame.inputs,
            contact.touches,
            self.demand.is_on(),
        );
        let references = &mut state.references;
        let landing = state.demand.landing_posture();
        let target = self
            .references
            .tick(references, model, contact, &phase, landing);
        state.observed.elapsed_ticks = elapsed_ticks;
        state.landing_p_ratio = target.landing_p_ratio;
        if phase.drives() {
            let output = self.demand.tick(
                &mut state.demand,
                &state.estimates,
                &phase,
                &target,
                state.command.saturated,
            );
            let torques = self.torques.tick(&mut state.command, &output);
            state.command.reference_velocity_m_s = target.reference.velocity_m_s;
            if let Err(fault) = torques {
                state.supervision.latch(fault);
                state.release();
            }
        } else {
            state.release();
        }
        let (estimates, command) = (&state.estimates, &state.command);
        answer.torques = command.counts;
        answer.reference_tip = Micrometres::from_metres(target.reference.position_m);
        answer.estimated_tip = Micrometres::from_metres(estimates.model.tip_m.x);
        answer.flags = flags(&estimates.contact, &target, command);
        let is_done = self.references.is_done(&state.references);
        answer.flags.set(StatusFlags::REFERENCE_DONE, is_done);
        let recovers = target.recovering && state.supervision.drives();
        answer.flags.set(StatusFlags::RECOVERING, recovers);
        report(answer, &state.supervision);
        if let Some(telemetry) = telemetry {
            let tick = frame.tick;
            telemetry.record(tick, estimates, &target, command, &state.supervision);
        }
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
        let (estimates, observed) = (&mut state.estimates, &state.observed);
        let estimators = &self.estimators;
        if estimates.contact.touches {
            let slow = estimators.learn_in_contact(estimates, observed);
            match turn {
                Turn::Balance => {
                    estimators.balance_torques(estimates);
                    if slow.shows_length {
                        estimators.calibrate(estimates);
                    }
                }
                Turn::Edges if slow.completes_block => estimators.evaluate_response(estimates),
                Turn::Edges => self.search(state),
            }
        } else {
            estimators.learn_in_the_air(estimates, observed);
            if turn == Turn::Balance {
                estimators.balance_torques(estimates);
            }
            // A tip that is being returned to the belt needs the edges soon.
            if turn == Turn::Edges || state.landing_p_ratio > 0.0 {
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
            state.landing_p_ratio,
        );
    }

    /// Prepares the estimates for the next readings.
    #[inline]
    pub fn prepare(&self, state: &mut State<L>) {
        let drives = state.supervision.drives();
        self.estimators
            .prepare(&mut state.estimates, &mut state.command, drives);
        self.references
            .prepare(&mut state.references, state.supervision.state());
        state.observed.last = state.command;
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

/// Returns the answer's flags that contact, target and command show.
fn flags(contact: &ContactEstimate, target: &Target, command: &LastCommand) -> StatusFlags {
    let friction = &contact.friction;
    let mut flags = StatusFlags::default();
    flags.set(StatusFlags::CONTACT, contact.touches);
    flags.set(StatusFlags::SATURATED, command.saturated);
    flags.set(StatusFlags::AT_EDGE, target.at_edge);
    flags.set(
        StatusFlags::SLIP_NEGATIVE,
        contact.touches && friction.slip == Slip::Negative,
    );
    flags.set(StatusFlags::STICKS, contact.touches && friction.sticks);
    flags
}

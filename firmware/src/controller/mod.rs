//! One control tick, from sensor counts to torque counts, as a pipeline of stages, and the update after it:
//!
//! ```text
//! frame ─ arrive ─ observe ─ supervise ─ refer ─ demand ─ torque output ─ answer
//!                     ↑                             ↑            │
//!                  prepare ←── learn, search ───────┴─── last command
//! ```
//!
//! The answer needs only what the readings of its tick decide. All else is updated after it, and prepared for the
//! readings of the next tick: the torque goes out earlier, and the update has the rest of the period (Åström and
//! Wittenmark, Computer-Controlled Systems, 3rd edition, chapter 9).
//!
//! Each stage consists of constant settings and a state of its own; the stages' signatures show the
//! data flow between them. At the end of a tick its results are written to the telemetry, which is
//! never read back.

mod arrival;
#[cfg(test)]
mod tests;

use painleve_shared::counts::{Micrometres, TorqueCounts};
use painleve_shared::frame::{ActuatorFrame, DigitalInputs, SensorFrame, StatusFlags};
use painleve_shared::range::OutOfRange;
use painleve_shared::status::Fault;
use painleve_shared::{Arm, Slip};

use self::arrival::{Arrival, ArrivalState, Lapses, ReadingRanges, arrive};
use crate::configuration::Configuration;
use crate::demand::{DemandInput, DemandState, TorqueDemand};
use crate::estimate::joint_friction::{JointFriction, JointFrictionState};
use crate::estimate::joints::Restart;
use crate::estimate::{EstimateSettings, EstimatesState, Estimators, Observed, Readings};
use crate::last_command::LastCommand;
use crate::law::{Law, LawSettings};
use crate::refer::{References, ReferencesState};
use crate::schedule::Turn;
use crate::supervise::lapses::{Lapse, LapseMonitor};
use crate::supervise::supervisor::{Supervision, Supervisor};
use crate::telemetry::{Telemetry, TelemetrySink, TelemetryTick};
use crate::torque_output::{NotFinite, TorqueOutput};

/// The controller of one arm, with the laws `L`.
///
/// ```
/// use painleve_firmware::{Configuration, Controller};
/// use painleve_shared::counts::{EncoderCounts, ForceCounts};
/// use painleve_shared::frame::{DigitalInputs, SensorFrame};
/// use painleve_shared::status::SupervisorState;
///
/// // The paper's arm and hybrid law at 1 kHz.
/// let configuration: Configuration = Configuration::default();
/// let mut controller = Controller::new(&configuration)?;
///
/// // The arm rests on the belt, pressed on it with 10 N, and the enable switch is closed. The second
/// // encoder measures the angle between the links.
/// let encoder = configuration.converters.encoders[0];
/// let [theta1, theta2] = [-11.4_f64, -35.1].map(f64::to_radians);
/// let force = |newtons| ForceCounts(configuration.converters.force.counts(newtons).0);
/// for tick in 0..100 {
///     let answer = controller.tick(&SensorFrame {
///         tick,
///         sequence: tick,
///         joints: [encoder.reading(theta1), encoder.reading(theta2 - theta1)],
///         normal_force: force(10.0),
///         tangential_force: force(-6.0),
///         inputs: DigitalInputs::ENABLE,
///     });
///     assert_eq!(answer.latched_fault(), None);
///     if tick > 20 {
///         assert_eq!(answer.supervisor_state(), Some(SupervisorState::Tracking));
///     }
/// }
///
/// // Readings that no encoder can give latch a fault, which takes the torque off.
/// for tick in 100..200 {
///     controller.tick(&SensorFrame {
///         tick,
///         sequence: tick,
///         joints: [EncoderCounts(u32::MAX); 2],
///         ..SensorFrame::default()
///     });
/// }
/// let answer = controller.tick(&SensorFrame::default());
/// assert!(answer.latched_fault().is_some());
/// assert_eq!(answer.torques.map(|torque| torque.0), [0, 0]);
/// # Ok::<(), painleve_shared::range::OutOfRange>(())
/// ```
// In this order: a Cortex-M4F loads floats only from the first kilobyte after a pointer. What a tick needs less of
// comes last.
#[derive(Clone, Debug)]
#[repr(C)]
pub struct Controller<L: Law = LawSettings> {
    last_answer: ActuatorFrame,
    state: State<L>,
    stages: Stages<L>,
    monitor: LapseMonitor,
    due: Due,
}

/// The update that is due after an answer.
#[derive(Clone, Copy, Debug, Default)]
enum Due {
    /// None: there were no new readings.
    #[default]
    Nothing,
    /// The preparation of the next tick: the readings were out of range, or the estimates have started from them.
    Preparation,
    /// All of it.
    Everything,
}

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
struct Stages<L> {
    estimators: Estimators,
    torques: TorqueOutput,
    joint_friction: JointFriction,
    supervisor: Supervisor,
    demand: TorqueDemand<L>,
    references: References,
    ranges: ReadingRanges,
}

/// State of the stages between ticks.
#[derive(Clone, Debug)]
#[repr(C)]
struct State<L: Law> {
    estimates: EstimatesState,
    command: LastCommand,
    /// The command before that.
    before: LastCommand,
    demand: DemandState<L>,
    supervision: Supervision,
    references: ReferencesState,
    answered: Answered,
    turn: Turn,
    arrivals: ArrivalState,
    joint_friction: JointFrictionState,
}

impl<L: Law> Controller<L> {
    /// Builds a controller that has received no frame yet.
    ///
    /// # Errors
    /// [`OutOfRange`] naming the first key that is out of range.
    pub fn new(configuration: &Configuration<L>) -> Result<Self, OutOfRange> {
        let arm = configuration.validate()?;
        let settings = &configuration.settings;
        let stages = Stages::new(configuration, &arm);
        let state = State {
            arrivals: ArrivalState::default(),
            estimates: stages.estimators.start(arm),
            supervision: Supervision::default(),
            references: stages.references.start(&arm),
            demand: stages.demand.start(),
            command: LastCommand::default(),
            before: LastCommand::default(),
            answered: Answered::default(),
            turn: Turn::default(),
            joint_friction: JointFrictionState::default(),
        };
        Ok(Self {
            last_answer: ActuatorFrame::default(),
            state,
            stages,
            monitor: LapseMonitor::new(settings.lapses),
            due: Due::Nothing,
        })
    }

    /// Answers one sensor frame and updates the state for the next one.
    #[inline]
    pub fn tick(&mut self, frame: &SensorFrame) -> ActuatorFrame {
        self.answer(frame);
        self.update();
        self.last_answer
    }

    /// Answers one sensor frame, updates the state for the next one, and writes the internal state to the telemetry.
    pub fn tick_with_telemetry(
        &mut self,
        frame: &SensorFrame,
        telemetry: &mut Telemetry,
    ) -> ActuatorFrame {
        self.answer_into(frame, TelemetrySink::to(telemetry));
        self.update();
        self.last_answer
    }

    /// Answers one sensor frame: the first part of a tick, after which the torque can go out. The second part is
    /// [`update`](Self::update).
    #[inline]
    pub fn answer(&mut self, frame: &SensorFrame) -> &ActuatorFrame {
        self.answer_in_place(frame);
        &self.last_answer
    }

    /// Returns the last answer.
    #[inline]
    pub fn last_answer(&self) -> &ActuatorFrame {
        &self.last_answer
    }

    // Out of line, because the compiler then finds fewer values that have to wait on the stack.
    #[inline(never)]
    fn answer_in_place(&mut self, frame: &SensorFrame) {
        self.answer_into(frame, TelemetrySink::nowhere());
    }

    /// Updates the state with the readings that the last [`answer`](Self::answer) has used, and prepares the next
    /// answer, which otherwise does this first.
    #[inline(never)]
    pub fn update(&mut self) {
        match core::mem::take(&mut self.due) {
            Due::Nothing => return,
            Due::Preparation => {}
            Due::Everything => self.stages.learn(&mut self.state),
        }
        self.stages.prepare(&mut self.state);
    }

    // Out of line: the bound on an answer's cycles leaves it out, because it proves that the update is in time.
    #[cold]
    #[inline(never)]
    fn catch_up(&mut self) {
        self.update();
    }

    /// Records how many times a lapse occurred around this tick, 0 for none. If it has now occurred
    /// too often, latches the fault and returns the last answer with zero torque, to be
    /// output at once.
    #[inline]
    pub fn note(&mut self, lapse: Lapse, times: u32) -> Option<ActuatorFrame> {
        let mut lapses = Lapses {
            monitor: &mut self.monitor,
            supervision: &mut self.state.supervision,
        };
        lapses.note(lapse, times).then(|| {
            self.stop(TelemetrySink::nowhere());
            self.last_answer
        })
    }

    /// Returns how often each kind of lapse has occurred.
    pub fn lapse_counts(&self) -> &LapseMonitor {
        &self.monitor
    }

    #[inline]
    fn answer_into(&mut self, frame: &SensorFrame, telemetry: TelemetrySink<'_>) {
        if !matches!(self.due, Due::Nothing) {
            self.catch_up();
        }
        let State {
            arrivals,
            supervision,
            ..
        } = &mut self.state;
        let lapses = Lapses {
            monitor: &mut self.monitor,
            supervision,
        };
        let arrival = arrive(&self.stages.ranges, arrivals, lapses, frame);
        let supervision = &mut self.state.supervision;
        match arrival {
            Arrival::After(elapsed_ticks) => {
                let readings = Readings {
                    frame,
                    elapsed_ticks,
                };
                let (state, answer) = (&mut self.state, &mut self.last_answer);
                self.due = match self.stages.answer(state, &readings, answer, telemetry) {
                    Ok(()) => Due::Everything,
                    Err(_) => Due::Preparation,
                };
            }
            // Without new readings, the last torque stays for a limited number of ticks.
            Arrival::Stale if supervision.drives() => {}
            Arrival::Stale => self.stop(telemetry),
            Arrival::OutOfRange => {
                let enabled = frame.inputs.contains(DigitalInputs::ENABLE);
                if !(supervision.drives() && enabled) {
                    if supervision.drives() {
                        supervision.disable();
                    }
                    self.stop(telemetry);
                }
                self.due = Due::Preparation;
            }
        }
        self.last_answer.tick = frame.tick;
        self.last_answer.sequence = self.last_answer.sequence.wrapping_add(1);
    }

    /// Takes the torque off without a tick.
    #[cold]
    #[inline(never)]
    fn stop(&mut self, telemetry: TelemetrySink<'_>) {
        self.state.release();
        let answer = &mut self.last_answer;
        answer.torques = [TorqueCounts(0); 2];
        report(answer, &self.state.supervision);
        answer
            .flags
            .remove(StatusFlags::SATURATED | StatusFlags::AT_EDGE | StatusFlags::RECOVERING);
        telemetry.stop(&self.state.supervision);
    }
}

impl<L: Law> Stages<L> {
    /// Makes the stages, each with its own settings.
    fn new(configuration: &Configuration<L>, arm: &Arm<f32>) -> Self {
        let Configuration {
            tick_hz,
            arm: parameters,
            converters,
            settings,
        } = configuration;
        let speeds = configuration.loop_speeds(arm);
        Self {
            estimators: Estimators::new(&EstimateSettings {
                tick_hz: *tick_hz,
                tracking_speed: speeds.tracking,
                encoders: converters.encoders,
                force: converters.force,
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
                settings.law.sped_up(speeds.law),
                &settings.recovery,
                configuration.tick_s(),
                settings.torque_limit_nm,
            ),
            torques: TorqueOutput::new(converters.torque, settings.torque_limit_nm),
            joint_friction: JointFriction::new(&settings.estimator, parameters.coulomb_friction_nm),
            ranges: ReadingRanges::of(converters),
        }
    }

    /// Answers readings.
    ///
    /// # Errors
    /// [`Restart`] if the estimates have started from these readings, which then show nothing else.
    #[inline]
    fn answer(
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
    fn learn(&self, state: &mut State<L>) {
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
    fn prepare(&self, state: &mut State<L>) {
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
    fn release(&mut self) {
        self.command.clear();
        self.demand.cancel_recovery();
    }
}

/// Returns state and fault of an answer.
fn report(answer: &mut ActuatorFrame, supervision: &Supervision) {
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

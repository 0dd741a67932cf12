//! One control tick, from sensor counts to torque counts, as a pipeline of stages:
//!
//! ```text
//! frame ─ arrive ─ estimate ─ supervise ─ refer ─ demand ─ torque output ─ answer
//!                     ↑                             ↑            │
//!                     └──────── last command ───────┴────────────┘
//! ```
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
use crate::estimate::joints::EncoderJump;
use crate::estimate::{EstimateSettings, EstimatesState, Estimators, Readings};
use crate::last_command::LastCommand;
use crate::law::{Law, LawSettings};
use crate::refer::{References, ReferencesState};
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
struct State<L: Law> {
    arrivals: ArrivalState,
    estimates: EstimatesState,
    supervision: Supervision,
    references: ReferencesState,
    demand: DemandState<L>,
    command: LastCommand,
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
            joint_friction: JointFrictionState::default(),
        };
        Ok(Self {
            last_answer: ActuatorFrame::default(),
            state,
            stages,
            monitor: LapseMonitor::new(settings.lapses),
        })
    }

    /// Answers one sensor frame.
    #[inline]
    pub fn tick(&mut self, frame: &SensorFrame) -> ActuatorFrame {
        self.tick_in_place(frame);
        self.last_answer
    }

    /// Answers one sensor frame and writes the internal state to the telemetry.
    pub fn tick_with_telemetry(
        &mut self,
        frame: &SensorFrame,
        telemetry: &mut Telemetry,
    ) -> ActuatorFrame {
        self.tick_into(frame, TelemetrySink::to(telemetry));
        self.last_answer
    }

    // Out of line, because the compiler then finds fewer values that have to wait on the stack.
    #[inline(never)]
    fn tick_in_place(&mut self, frame: &SensorFrame) {
        self.tick_into(frame, TelemetrySink::nowhere());
    }

    /// Records how many times a lapse occurred around this tick, 0 for none. If it has now occurred
    /// too often in a row, latches the fault and returns the last answer with zero torque, to be
    /// output at once.
    #[inline]
    pub fn note(&mut self, lapse: Lapse, times: u32) -> Option<ActuatorFrame> {
        let State {
            supervision,
            command,
            ..
        } = &mut self.state;
        let mut lapses = Lapses {
            monitor: &mut self.monitor,
            supervision,
            command,
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
    fn tick_into(&mut self, frame: &SensorFrame, telemetry: TelemetrySink<'_>) {
        let State {
            arrivals,
            supervision,
            command,
            ..
        } = &mut self.state;
        let lapses = Lapses {
            monitor: &mut self.monitor,
            supervision,
            command,
        };
        let arrival = arrive(&self.stages.ranges, arrivals, lapses, frame);
        let supervision = &mut self.state.supervision;
        match arrival {
            Arrival::After(elapsed_ticks) => {
                let readings = Readings {
                    frame,
                    elapsed_ticks,
                };
                self.stages
                    .tick(&mut self.state, &readings, &mut self.last_answer, telemetry);
            }
            // Without new readings, the last torque stays for a limited number of ticks.
            Arrival::Stale if supervision.drives() => {}
            Arrival::OutOfRange
                if supervision.drives() && frame.inputs.contains(DigitalInputs::ENABLE) => {}
            Arrival::Stale => self.stop(telemetry),
            Arrival::OutOfRange => {
                if supervision.drives() {
                    supervision.disable();
                }
                self.stop(telemetry);
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
        answer.flags.remove(
            StatusFlags::SATURATED
                | StatusFlags::GUARDED
                | StatusFlags::AT_EDGE
                | StatusFlags::RECOVERING,
        );
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
            torques: TorqueOutput::new(
                &settings.guard,
                converters.torque,
                settings.torque_limit_nm,
            ),
            joint_friction: JointFriction::new(&settings.estimator, parameters.coulomb_friction_nm),
            ranges: ReadingRanges::of(converters),
        }
    }

    /// Runs one tick, from readings to the answer.
    #[inline]
    fn tick(
        &self,
        state: &mut State<L>,
        readings: &Readings<'_>,
        answer: &mut ActuatorFrame,
        telemetry: TelemetrySink<'_>,
    ) {
        let joints = self
            .estimators
            .follow_joints(&mut state.estimates, readings, &state.command);
        if let Err(EncoderJump) = joints {
            state.supervision.latch(Fault::EncoderJump);
        }
        let model = state
            .estimates
            .model(&self.joint_friction, &mut state.joint_friction);
        let (mut contact, slow) = self.estimators.observe_contact(
            &mut state.estimates,
            &model,
            readings,
            &state.command,
            state.supervision.drives(),
        );
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
            .begin(references, &model, &contact, &phase, landing);
        // Slow estimates and the search for the edges take turns, so that no tick is long. Each branch
        // excludes the other's work, as the bound on a tick's cycles can see.
        let (estimates, last) = (&mut state.estimates, &state.command);
        let tip_t_m = model.tip_m.x;
        if readings.frame.tick & 1 == 0 {
            let is_busy = self
                .estimators
                .evaluate_response(estimates, &mut contact, &slow, last);
            if !is_busy {
                let (arm, margins) = (&estimates.arm, beginning.margins(&contact));
                self.references
                    .search(references, arm, tip_t_m, contact.friction, margins);
            }
        } else {
            self.estimators
                .balance_torques(estimates, &model, &contact, &slow, last);
            if beginning.needs_edges(&contact) {
                let (arm, margins) = (&estimates.arm, beginning.margins(&contact));
                self.references
                    .search(references, arm, tip_t_m, contact.friction, margins);
            } else {
                self.estimators.calibrate(estimates, &slow);
            }
        }
        let target = self.references.tick(references, &beginning, &model, &phase);
        let arm = &state.estimates.arm;
        if phase.drives() {
            let input = DemandInput {
                arm,
                model: &model,
                contact: &contact,
                phase: &phase,
                target: &target,
                last: &state.command,
            };
            let output = self.demand.tick(&mut state.demand, &input);
            let torques = self
                .torques
                .tick(&mut state.command, &output, &model, &contact);
            if let Err(NotFinite) = torques {
                state.supervision.latch(Fault::NotFinite);
            }
        }
        state.command.reference_velocity_m_s = target.reference.velocity_m_s;
        state.command.at_edge = target.at_edge;
        if !state.supervision.drives() {
            state.release();
        }
        let tick = TelemetryTick {
            model: &model,
            contact: &contact,
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
    flags.set(StatusFlags::GUARDED, command.guarded);
    flags.set(StatusFlags::AT_EDGE, target.at_edge);
    flags.set(StatusFlags::RECOVERING, *recovering);
    flags.set(
        StatusFlags::SLIP_NEGATIVE,
        contact.touches && friction.slip == Slip::Negative,
    );
    flags.set(StatusFlags::STICKS, contact.touches && friction.sticks);
    flags
}

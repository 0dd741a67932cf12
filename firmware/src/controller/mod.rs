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
//! Each stage holds its settings, which never change, and its state; the stages' signatures show the
//! data flow between them.

mod arrival;
mod stages;
#[cfg(test)]
mod tests;

use painleve_shared::counts::TorqueCounts;
use painleve_shared::frame::{ActuatorFrame, SensorFrame, StatusFlags};
use painleve_shared::range::OutOfRange;

use self::arrival::ArrivalState;
use crate::configuration::Configuration;
use crate::demand::TorqueDemand;
use crate::estimate::belt::BeltEstimator;
use crate::estimate::calibration::LengthCalibrator;
use crate::estimate::contact::ContactDetector;
use crate::estimate::disturbance::DisturbanceEstimator;
use crate::estimate::friction::{FrictionEstimate, FrictionEstimator};
use crate::estimate::joint_friction::JointFriction;
use crate::estimate::joints::{JointEstimator, JointEstimatorSettings};
use crate::estimate::model::Model;
use crate::estimate::response::ResponseEstimator;
use crate::estimate::{ContactEstimate, Estimators, Observed};
use crate::last_command::LastCommand;
use crate::law::{Law, LawSettings};
use crate::refer::governor::EdgeGovernor;
use crate::refer::reference::ReferenceGenerator;
use crate::refer::{References, Target};
use crate::schedule::Turn;
use crate::supervise::lapses::{Lapse, LapseMonitor};
use crate::supervise::supervisor::Supervisor;
use crate::torque_output::TorqueOutput;

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
// In this order: a Cortex-M4F loads floats only from the first kilobyte after a pointer. What a tick needs less of comes
// last.
#[derive(Clone, Debug)]
#[repr(C)]
pub struct Controller<L: Law = LawSettings> {
    last_answer: ActuatorFrame,
    command: LastCommand,
    demand: TorqueDemand<L>,
    torques: TorqueOutput,
    /// What is known of arm, contact and belt.
    estimates: Estimators,
    references: References,
    /// Whether the arm is driven, and the latched fault.
    supervisor: Supervisor,
    /// The tick that has been answered, for its update.
    observed: Observed,
    turn: Turn,
    /// What has arrived.
    arrivals: ArrivalState,
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

impl<L: Law> Controller<L> {
    /// Builds a controller that has received no frame yet.
    ///
    /// # Errors
    /// [`OutOfRange`] naming the first key that is out of range.
    pub fn new(configuration: &Configuration<L>) -> Result<Self, OutOfRange> {
        let arm = configuration.validate()?;
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
        let (kept_m, reach_m) = (configuration.kept_distance_m(), arm.reach_on_belt_m());
        let governor = EdgeGovernor::new(&settings.governor, tick_s, kept_m, reach_m);
        let generator = ReferenceGenerator::new(&settings.reference, tick_hz);
        Ok(Self {
            last_answer: ActuatorFrame::default(),
            due: Due::Nothing,
            estimates,
            command: LastCommand::default(),
            demand: TorqueDemand::new(configuration, speed, torques.limit_nm()),
            supervisor: Supervisor::new(settings.supervisor, settings.lapses, tick_hz),
            references: References::new(governor, generator, settings.recovery.minimum_p_ratio),
            observed: Observed::default(),
            turn: Turn::default(),
            arrivals: ArrivalState::default(),
            torques,
        })
    }

    /// Answers one sensor frame and updates the state for the next one.
    #[inline]
    pub fn tick(&mut self, frame: &SensorFrame) -> ActuatorFrame {
        self.answer(frame);
        self.update();
        self.last_answer
    }

    /// Answers one sensor frame: the first part of a tick, after which the torque can go out. The second part is
    /// [`update`](Self::update).
    #[inline(never)]
    pub fn answer(&mut self, frame: &SensorFrame) -> &ActuatorFrame {
        self.answer_and_show(frame, |_, _, _| {});
        &self.last_answer
    }

    /// Returns the last answer.
    #[inline]
    pub fn last_answer(&self) -> &ActuatorFrame {
        &self.last_answer
    }

    /// Updates the state with the readings that the last [`answer`](Self::answer) has used, and prepares the next
    /// answer, which otherwise does this first.
    #[inline(never)]
    pub fn update(&mut self) {
        match core::mem::take(&mut self.due) {
            Due::Nothing => return,
            Due::Preparation => {}
            Due::Everything => self.learn(),
        }
        self.prepare();
    }

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
        self.supervisor.note(lapse, times).then(|| {
            self.stop();
            self.last_answer
        })
    }

    /// Returns how often each kind of lapse has occurred.
    pub fn lapses(&self) -> &LapseMonitor {
        &self.supervisor.lapses
    }

    /// Returns supervisor and last answer, for a drive that stands in for the controller.
    pub(crate) fn stand_in(&mut self) -> (&mut Supervisor, &mut ActuatorFrame) {
        (&mut self.supervisor, &mut self.last_answer)
    }

    /// [Answers](Self::answer), and shows what the answer followed from, for logs and displays; of a tick without new
    /// readings, nothing.
    #[inline]
    pub fn answer_and_show(
        &mut self,
        frame: &SensorFrame,
        show: impl FnOnce(&Estimators, &Target, &LastCommand),
    ) {
        if !matches!(self.due, Due::Nothing) {
            self.catch_up();
        }
        match self.arrive(frame) {
            Some(elapsed_ticks) => self.follow(frame, elapsed_ticks, show),
            // Without new readings, the last torque stays for a limited number of ticks.
            None if self.supervisor.state().drives() => {}
            None => self.stop(),
        }
        self.last_answer.tick = frame.tick;
        self.last_answer.sequence = self.last_answer.sequence.wrapping_add(1);
    }

    /// Takes the torque off without a tick.
    #[cold]
    #[inline(never)]
    fn stop(&mut self) {
        self.release();
        let answer = &mut self.last_answer;
        answer.torques = [TorqueCounts(0); 2];
        self.supervisor.report(answer);
        answer
            .flags
            .remove(StatusFlags::SATURATED | StatusFlags::AT_EDGE | StatusFlags::RECOVERING);
    }
}

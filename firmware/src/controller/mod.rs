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
//! data flow between them. At the end of a tick its results are written to the telemetry, on which
//! nothing depends.

mod arrival;
mod stages;
#[cfg(test)]
mod tests;

use painleve_shared::counts::TorqueCounts;
use painleve_shared::frame::{ActuatorFrame, DigitalInputs, SensorFrame, StatusFlags};
use painleve_shared::range::OutOfRange;

use self::arrival::{Arrival, arrive};
use self::stages::{Stages, report};
use crate::configuration::Configuration;
use crate::law::{Law, LawSettings};
use crate::supervise::lapses::{Lapse, LapseMonitor};
use crate::telemetry::Telemetry;

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
#[derive(Clone, Debug)]
#[repr(C)]
pub struct Controller<L: Law = LawSettings> {
    last_answer: ActuatorFrame,
    stages: Stages<L>,
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
        Ok(Self {
            last_answer: ActuatorFrame::default(),
            stages: Stages::new(configuration, arm),
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
        self.answer_into(frame, Some(telemetry));
        self.update();
        self.last_answer
    }

    /// Answers one sensor frame: the first part of a tick, after which the torque can go out. The second part is
    /// [`update`](Self::update).
    #[inline(never)]
    pub fn answer(&mut self, frame: &SensorFrame) -> &ActuatorFrame {
        self.answer_into(frame, None);
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
            Due::Everything => self.stages.learn(),
        }
        self.stages.prepare();
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
        self.stages.supervisor.note(lapse, times).then(|| {
            self.stop(None);
            self.last_answer
        })
    }

    /// Returns how often each kind of lapse has occurred.
    pub fn lapses(&self) -> &LapseMonitor {
        &self.stages.supervisor.lapses
    }

    /// Returns the same, for a drive that stands in for the controller.
    pub(crate) fn lapses_mut(&mut self) -> &mut LapseMonitor {
        &mut self.stages.supervisor.lapses
    }

    #[inline]
    fn answer_into(&mut self, frame: &SensorFrame, telemetry: Option<&mut Telemetry>) {
        if !matches!(self.due, Due::Nothing) {
            self.catch_up();
        }
        let Stages {
            estimates,
            supervisor,
            arrivals,
            ..
        } = &mut self.stages;
        match arrive(arrivals, supervisor, estimates, frame) {
            Arrival::After(elapsed_ticks) => {
                let answer = &mut self.last_answer;
                let followed = self.stages.answer(frame, elapsed_ticks, answer, telemetry);
                self.due = match followed {
                    Ok(()) => Due::Everything,
                    Err(_) => Due::Preparation,
                };
            }
            // Without new readings, the last torque stays for a limited number of ticks.
            arrival => {
                if arrival == Arrival::OutOfRange {
                    self.due = Due::Preparation;
                    if supervisor.drives() && !frame.inputs.contains(DigitalInputs::ENABLE) {
                        supervisor.disable();
                    }
                }
                if !supervisor.drives() {
                    self.stop(telemetry);
                }
            }
        }
        self.last_answer.tick = frame.tick;
        self.last_answer.sequence = self.last_answer.sequence.wrapping_add(1);
    }

    /// Takes the torque off without a tick.
    #[cold]
    #[inline(never)]
    fn stop(&mut self, telemetry: Option<&mut Telemetry>) {
        self.stages.release();
        let answer = &mut self.last_answer;
        answer.torques = [TorqueCounts(0); 2];
        report(answer, &self.stages.supervisor);
        answer
            .flags
            .remove(StatusFlags::SATURATED | StatusFlags::AT_EDGE | StatusFlags::RECOVERING);
        if let Some(telemetry) = telemetry {
            telemetry.stop(&self.stages.supervisor);
        }
    }
}

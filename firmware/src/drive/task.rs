//! The control task: one tick with sampling, actuation, update and monitoring.

use painleve_shared::counts::TorqueCounts;
use painleve_shared::frame::{ActuatorFrame, SensorFrame};
use painleve_shared::message::FrameSource;
use painleve_shared::range::OutOfRange;

use super::Drive;
use super::open_loop::OpenLoop;
use crate::configuration::Configuration;
use crate::controller::Controller;
use crate::law::{Law, LawSettings};
use crate::supervise::lapses::{Lapse, LapseMonitor};

/// The answer to one tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Answered<'a> {
    /// The sensor frame; `None` for an answer without one, sent because a fault has taken the torque off, and for the
    /// answer of a late tick.
    pub sensor: Option<&'a SensorFrame>,
    /// The frame that takes effect.
    pub frame: &'a ActuatorFrame,
    /// Duration of the controller's tick, answer and update, in counts of [`Drive::stopwatch`]; 0 for a fault that was
    /// latched without one.
    pub elapsed: u32,
}

/// What is due after an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Due {
    /// Nothing: there was no answer.
    Nothing,
    /// The report of an answer: one without a sensor frame, or that of a late tick.
    Report,
    /// The controller's update.
    Update,
}

/// Statistics since the controller was configured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TaskCounts {
    /// Ticks that answered a frame; wraps.
    pub ticks: u32,
    /// Longest of these ticks, in counts of [`Drive::stopwatch`].
    pub worst_elapsed: u32,
}

/// Drives an arm tick by tick: samples, runs the controller, actuates, and records missing frames
/// and overruns. It is the same on a PC, under an emulator and on a board.
///
/// A tick has two parts: [`answer`](Self::answer) ends with the torque, [`update`](Self::update) prepares the next
/// tick. A board runs them in tasks of different priority.
///
/// ```
/// use painleve_firmware::drive::{ControlTask, Drive};
/// use painleve_firmware::Configuration;
/// use painleve_shared::frame::{ActuatorFrame, DigitalInputs, SensorFrame};
/// use painleve_shared::message::FrameSource;
///
/// /// A drive without an arm: its sensors read zero, its stages only record the answer.
/// #[derive(Default)]
/// struct Desk {
///     frames: u32,
///     answer: ActuatorFrame,
/// }
///
/// impl Drive for Desk {
///     fn begin_tick(&mut self) {}
///
///     fn sample(&mut self) -> Option<SensorFrame> {
///         self.frames += 1;
///         let (tick, sequence) = (self.frames, self.frames);
///         Some(SensorFrame { tick, sequence, inputs: DigitalInputs::ENABLE, ..Default::default() })
///     }
///
///     fn actuate(&mut self, answer: &ActuatorFrame) {
///         self.answer = *answer;
///     }
///
///     fn next_tick_is_due(&self) -> bool {
///         false
///     }
///
///     fn stopwatch(&self) -> u32 {
///         0
///     }
/// }
///
/// let mut task: ControlTask<Desk> = ControlTask::new(Desk::default());
/// task.configure(&Configuration::default(), FrameSource::Sensors)?;
/// let answered = task.tick().expect("a frame is available");
/// let answer = *answered.frame;
/// assert_eq!(task.drive().answer, answer);
/// # Ok::<(), painleve_shared::range::OutOfRange>(())
/// ```
// In this order, so that the controller is at the beginning: see its fields.
#[derive(Debug)]
#[repr(C)]
pub struct ControlTask<D, L: Law = LawSettings> {
    /// `None` until the task is configured.
    controller: Option<Controller<L>>,
    drive: D,
    /// Replaces the controller's ticks with [`FrameSource::Commissioning`].
    open_loop: Option<OpenLoop>,
    source: FrameSource,
    /// The newest sensor frame, and the duration of its answer.
    sensor: Option<SensorFrame>,
    elapsed: u32,
    due: Due,
    counts: TaskCounts,
}

impl<D: Drive, L: Law> ControlTask<D, L> {
    /// Makes a task without a configuration, which does nothing.
    pub const fn new(drive: D) -> Self {
        Self {
            controller: None,
            drive,
            open_loop: None,
            source: FrameSource::Lockstep,
            sensor: None,
            elapsed: 0,
            due: Due::Nothing,
            counts: TaskCounts {
                ticks: 0,
                worst_elapsed: 0,
            },
        }
    }

    /// Starts afresh with this configuration and frames from `source`, after taking the torque off.
    ///
    /// # Errors
    /// [`OutOfRange`] naming the first key that is out of range. The task then stays without a
    /// configuration.
    // Out of line: building a controller does not share the stack with its ticks.
    #[inline(never)]
    pub fn configure(
        &mut self,
        configuration: &Configuration<L>,
        source: FrameSource,
    ) -> Result<(), OutOfRange> {
        self.stop();
        self.source = source;
        self.counts = TaskCounts::default();
        self.controller = Some(Controller::new(configuration)?);
        let is_open = source == FrameSource::Commissioning;
        self.open_loop = is_open.then(|| OpenLoop::new(configuration));
        Ok(())
    }

    /// Takes the torque off and drops the configuration; further ticks do nothing.
    pub fn stop(&mut self) {
        self.drive.actuate(&ActuatorFrame::default());
        self.controller = None;
        self.open_loop = None;
        self.due = Due::Nothing;
    }

    /// Commands torques; without effect unless the source is [`FrameSource::Commissioning`].
    pub fn request_torques(&mut self, torques: [TorqueCounts; 2]) {
        if let Some(open_loop) = &mut self.open_loop {
            open_loop.request(torques);
        }
    }

    /// Stops as [`stop`](Self::stop) does, when a tick is due.
    pub fn stop_instead_of_tick(&mut self) {
        self.drive.begin_tick();
        self.stop();
    }

    /// Runs one tick; returns `None` if there is no answer to send.
    pub fn tick(&mut self) -> Option<Answered<'_>> {
        self.answer();
        self.update()
    }

    /// Samples, answers and actuates: the first part of a tick.
    #[inline]
    pub fn answer(&mut self) {
        if self.due != Due::Nothing {
            self.finish_late_tick();
        }
        self.drive.begin_tick();
        let Some(controller) = &mut self.controller else {
            self.drive.actuate(&ActuatorFrame::default());
            return;
        };
        self.sensor = self.drive.sample();
        let Some(frame) = &self.sensor else {
            // In lockstep time stands still until a frame comes.
            let missing = u32::from(self.source != FrameSource::Lockstep);
            if let Some(stopped) = controller.note(Lapse::MissingFrame, missing) {
                self.drive.actuate(&stopped);
                self.elapsed = 0;
                self.due = Due::Report;
            }
            return;
        };
        controller.note(Lapse::MissingFrame, 0);
        let start = self.drive.stopwatch();
        let answer = match &mut self.open_loop {
            None => controller.answer(frame),
            Some(open_loop) => open_loop.tick(frame, controller.stand_in()),
        };
        self.elapsed = self.drive.stopwatch().wrapping_sub(start);
        self.drive.actuate(answer);
        self.due = Due::Update;
    }

    /// Updates the controller after an answer, and records whether that was in time: the second part of a tick.
    /// Returns `None` if there is no answer to send.
    #[inline]
    pub fn update(&mut self) -> Option<Answered<'_>> {
        let due = core::mem::replace(&mut self.due, Due::Nothing);
        if due == Due::Nothing {
            return None;
        }
        let controller = self.controller.as_mut()?;
        if due == Due::Update {
            let start = self.drive.stopwatch();
            controller.update();
            let duration = self.drive.stopwatch().wrapping_sub(start);
            self.elapsed = self.elapsed.wrapping_add(duration);
            self.drive.end_tick();
            self.counts.ticks = self.counts.ticks.wrapping_add(1);
            self.counts.worst_elapsed = self.counts.worst_elapsed.max(self.elapsed);
            if self.drive.next_tick_is_due() {
                self.note_overrun();
            } else {
                controller.note(Lapse::Overrun, 0);
            }
        }
        let controller = self.controller.as_ref()?;
        Some(Answered {
            sensor: self.sensor.as_ref(),
            frame: controller.last_answer(),
            elapsed: self.elapsed,
        })
    }

    /// Finishes a tick whose update was still due when the next one began: an overrun. Its answer is reported late, unless
    /// the next tick has one.
    // Out of line: the bound on a tick's cycles leaves it out, because it proves that no tick overruns.
    #[cold]
    #[inline(never)]
    fn finish_late_tick(&mut self) {
        if self.update().is_some() {
            self.due = Due::Report;
        }
    }

    /// Records an overrun after an answer. If overruns have now occurred too often, the torque is off
    /// on return.
    // Out of line: the bound on a tick's cycles leaves it out, because it proves that no tick overruns.
    #[cold]
    #[inline(never)]
    fn note_overrun(&mut self) {
        self.note(Lapse::Overrun, 1);
    }

    /// Records how many times a lapse occurred between two ticks, 0 for none. If it has now occurred
    /// too often, the torque is off on return.
    pub fn note(&mut self, lapse: Lapse, times: u32) {
        if let Some(controller) = &mut self.controller
            && let Some(stopped) = controller.note(lapse, times)
        {
            self.drive.actuate(&stopped);
        }
    }

    /// Returns how often each kind of lapse has occurred; `None` without a configuration.
    pub fn lapses(&self) -> Option<&LapseMonitor> {
        self.controller.as_ref().map(Controller::lapses)
    }

    /// Returns the source of the frames.
    pub fn source(&self) -> FrameSource {
        self.source
    }

    /// Returns the statistics of the ticks.
    pub fn counts(&self) -> TaskCounts {
        self.counts
    }

    /// Returns the drive.
    pub fn drive(&self) -> &D {
        &self.drive
    }

    /// Returns the drive for changes, for example to offer it a frame.
    pub fn drive_mut(&mut self) -> &mut D {
        &mut self.drive
    }
}

#[cfg(test)]
mod tests;

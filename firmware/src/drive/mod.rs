//! The hardware interface of a tick, and the task that runs ticks on it.
//!
//! - [`open_loop`]: torques from the host instead of a law
//! - [`Drive`]: the hardware interface of the control task
//! - [`ControlTask`]: one control tick with sampling, actuation and monitoring, on every host

pub mod open_loop;
mod task;

pub use self::task::{Answered, ControlTask, TaskCounts};
pub use painleve_shared::message::FrameSource;

use painleve_shared::frame::{ActuatorFrame, SensorFrame};

/// The hardware interface of the control task, implemented by boards and simulations.
///
/// # Order of calls
/// The calls of one tick are, in this order: [`begin_tick`](Self::begin_tick),
/// [`sample`](Self::sample) if there is a configuration, [`actuate`](Self::actuate) if there is an answer, then,
/// if it answers a frame, [`end_tick`](Self::end_tick) and [`next_tick_is_due`](Self::next_tick_is_due), and
/// `actuate` again if an overrun, or a message received in between, has latched a fault. Without a configuration,
/// `actuate` takes the torque off. [`stopwatch`](Self::stopwatch) may be called at any time.
///
/// # Time
/// Every call returns in bounded time. All calls of a tick together with the controller's tick take
/// less than the control period. Only `sample` may wait for the tick to begin, on a host where the
/// arrival of a frame starts the tick.
///
/// # Faults
/// No call panics or returns an error. A sensor that cannot be read gives a reading out of range; a
/// missing frame is `None`. The controller counts both and latches a fault if too many occur in a
/// row.
///
/// An answer with zero torque in state idle or fault switches the torque stages off before
/// `actuate` returns. They stay off until an answer in another state. A drive that detects its own
/// failure switches them off by itself.
pub trait Drive {
    /// Marks the beginning of a tick: from now on, [`next_tick_is_due`](Self::next_tick_is_due)
    /// refers to the following tick.
    fn begin_tick(&mut self);

    /// Returns the newest sensor frame; `None` if none has arrived since the last call. No frame is
    /// returned twice.
    fn sample(&mut self) -> Option<SensorFrame>;

    /// Outputs an answer's torques. If called again within a tick, the last call takes effect;
    /// repeating the same answer changes nothing.
    fn actuate(&mut self, answer: &ActuatorFrame);

    /// Does what a tick need not do before its torque is out. Nothing by default.
    fn end_tick(&mut self) {}

    /// Returns whether the next tick should have begun already, without side effects.
    fn next_tick_is_due(&self) -> bool;

    /// Returns a free-running count that times a tick; wraps.
    fn stopwatch(&self) -> u32;
}

//! The hardware around a tick, and the task that drives it.
//!
//! - [`torque`]: from wanted torques to counts: kept on the belt, limited, rounded
//! - [`Drive`]: what the control task needs of the hardware, or of a stand-in for it
//! - [`ControlTask`]: one control tick with everything around it, on every host

mod task;
pub mod torque;

pub use self::task::{Answered, ControlTask, TaskCounts};

use painleve_shared::frame::{ActuatorFrame, SensorFrame};

/// What the control task needs of the hardware, or of a stand-in for it.
///
/// # Order of calls
/// Once a tick, in this order: [`begin_tick`](Self::begin_tick), [`sample`](Self::sample),
/// [`actuate`](Self::actuate) if there is an answer,
/// [`next_tick_is_due`](Self::next_tick_is_due), and `actuate` again if that, or a message that
/// came in between, has latched a fault. [`stopwatch`](Self::stopwatch) may be called at any time.
///
/// # Time
/// Every call returns in bounded time, and all of a tick's calls together with the controller's
/// tick in less than the time between two ticks. `sample` alone may wait for the tick to begin,
/// on a host whose clock is the arrival of frames.
///
/// # Faults
/// None of the calls panics or fails. A sensor that cannot be read is a reading that is out of
/// range; frames that do not come are `None`; the controller counts both and latches a fault when
/// there are too many.
///
/// An answer with torque zero in state idle or fault switches the torque stages off before
/// `actuate` returns. They stay off until an answer in another state. A drive that sees by itself
/// that it cannot go on does the same without being asked.
pub trait Drive {
    /// Takes note that a tick begins: from now on, [`next_tick_is_due`](Self::next_tick_is_due)
    /// tells of the next one.
    fn begin_tick(&mut self);

    /// The newest sensor frame; `None` if none has come since the last call. The same frame is not
    /// returned twice.
    fn sample(&mut self) -> Option<SensorFrame>;

    /// Puts out an answer's torques. Called again within a tick, the last call counts; the same
    /// answer again changes nothing.
    fn actuate(&mut self, answer: &ActuatorFrame);

    /// Whether the next tick should have begun already. Asking changes nothing.
    fn next_tick_is_due(&self) -> bool;

    /// A running count that times a tick; wraps.
    fn stopwatch(&self) -> u32;
}

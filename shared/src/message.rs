//! What a board and its host say to each other over bytes, encoded by
//! [`wire`](crate::wire): one request, one response.
//!
//! The configuration comes first, so that one image serves every scenario. Its
//! type belongs to the controller, hence the parameter.

use serde::{Deserialize, Serialize};

use crate::frame::{ActuatorFrame, SensorFrame};

/// Longest encoded message, in bytes: a configuration with a full reference.
pub const MAXIMUM_LENGTH: usize = 512;

/// What the host asks of the board.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Request<C> {
    /// Start afresh; [`Response::Ready`] or [`Response::Refused`].
    Configure {
        /// Configuration of the controller.
        configuration: C,
        /// Where its sensor frames come from.
        plant: Plant,
    },
    /// Control one tick of a simulated plant; [`Response::Actuator`].
    Sensor(SensorFrame),
    /// Tell what was counted since the configuration; [`Response::Health`].
    Health,
}

/// Where a controller's sensor frames come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Plant {
    /// From the host, in [`Request::Sensor`], who waits for every answer.
    Lockstep,
    /// From the host by the clock: a tick of the board's timer without a frame is a lapse.
    Realtime,
    /// From the board's own sensors, at every tick of its timer.
    Real,
}

/// What the board answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Response {
    /// The configuration is accepted and the control timer runs.
    Ready,
    /// The configuration has a number that is out of range.
    Refused,
    /// The answer to a sensor frame.
    Actuator {
        /// The frame.
        frame: ActuatorFrame,
        /// What the tick took, in counts of the board's stopwatch: processor
        /// cycles on hardware, nanoseconds of virtual time under an emulator.
        elapsed: u32,
    },
    /// Counters.
    Health(Health),
}

/// What a board has counted since its configuration. Counters wrap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Health {
    /// Most stack ever used since the start, bytes.
    pub stack_bytes: u32,
    /// Ticks controlled.
    pub ticks: u32,
    /// Messages that were no message: framing, checksum or content was wrong.
    pub corrupt_messages: u32,
    /// Answers that nobody took in time.
    pub dropped_responses: u32,
    /// Ticks without a sensor frame from a host that goes by the clock.
    pub missing_frames: u32,
    /// Ticks that ended after the next one should have begun.
    pub overruns: u32,
}

//! What a board and its host say to each other over bytes, encoded by
//! [`wire`](crate::wire): one request, one response.
//!
//! The configuration comes first, so that one image serves every scenario.

use serde::{Deserialize, Serialize};

use crate::frame::{ActuatorFrame, SensorFrame};
use crate::lapse::LapseCounts;

/// Longest encoded message, in bytes: a configuration with a full reference.
pub const MAXIMUM_LENGTH: usize = 768;

/// Longest encoded response, in bytes.
pub const MAXIMUM_RESPONSE_LENGTH: usize = 80;

/// What the host asks of the board.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Request<'a> {
    /// Start afresh; [`Response::Ready`], [`Response::Refused`] or [`Response::OtherBuild`].
    Configure {
        /// What tells the host's build from another.
        build: u64,
        /// Where its sensor frames come from.
        source: FrameSource,
        /// Configuration of the controller, whose type is the controller's, by postcard.
        configuration: &'a [u8],
    },
    /// Control one tick of a simulated plant; [`Response::Actuator`].
    Sensor(SensorFrame),
    /// Tell what was counted since the configuration; [`Response::Health`].
    Health,
    /// Take the torque off and forget the configuration; [`Response::Stopped`].
    Stop,
    /// The host is still there; no response. With [`FrameSource::Sensors`] the board stops without.
    Alive,
}

/// Where a controller's sensor frames come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum FrameSource {
    /// From the host, in [`Request::Sensor`], who waits for every answer.
    Lockstep,
    /// From the host in time: a tick of the board's timer without a frame is a lapse.
    Realtime,
    /// From the board's own sensors, at every tick of its timer.
    Sensors,
}

/// What the board answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Response {
    /// The configuration is accepted and the control timer runs.
    Ready {
        /// How fast the stopwatch of the answers counts, Hz: the processor's clock on
        /// hardware, 10⁹ of virtual time under an emulator.
        stopwatch_hz: u32,
    },
    /// The configuration has a number that is out of range.
    Refused,
    /// The configuration comes from another build: its bytes may mean something else.
    OtherBuild {
        /// What tells the board's build from another.
        build: u64,
    },
    /// The torque is off, and there is no configuration any more.
    Stopped,
    /// The answer to a sensor frame.
    Actuator {
        /// The frame.
        frame: ActuatorFrame,
        /// What the tick took, in counts of the board's stopwatch; 0 for an answer
        /// that nobody asked for, because a fault has taken the torque off.
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
    /// Answers that nobody took in time.
    pub dropped_responses: u32,
    /// Lapses, by kind.
    pub lapses: LapseCounts,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::counts::{Micrometres, TorqueCounts};
    use crate::frame::StatusFlags;
    use crate::wire;

    #[test]
    fn the_longest_responses_fit_their_buffer() {
        let frame = ActuatorFrame {
            tick: u32::MAX,
            sequence: u32::MAX,
            torques: [TorqueCounts(i32::MIN); 2],
            reference_tip: Micrometres(i32::MIN),
            estimated_tip: Micrometres(i32::MIN),
            state: u8::MAX,
            fault: u8::MAX,
            flags: StatusFlags(u16::MAX),
        };
        let elapsed = u32::MAX;
        let health = Health {
            stack_bytes: u32::MAX,
            ticks: u32::MAX,
            dropped_responses: u32::MAX,
            lapses: LapseCounts::from_fn(|_| u32::MAX),
        };
        let mut buffer = [0; MAXIMUM_RESPONSE_LENGTH];
        for response in [
            Response::Actuator { frame, elapsed },
            Response::Health(health),
        ] {
            assert!(wire::encode(&response, &mut buffer).is_ok(), "{response:?}");
        }
    }

    /// At 921,600 baud and ten bits a byte, 92 bytes pass in a millisecond.
    #[test]
    fn a_tick_at_1_khz_leaves_room_on_the_line_for_the_longest_frames() {
        let mut buffer = [0; MAXIMUM_RESPONSE_LENGTH];
        let request = wire::encode(&Request::Sensor(SensorFrame::LONGEST), &mut buffer);
        assert!(request.is_ok_and(|bytes| bytes.len() <= 46));
    }
}

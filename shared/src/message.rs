//! Requests and responses that a host and a board exchange as bytes, encoded by
//! [`wire`](crate::wire). Each request gets one response, except `Alive` and `Torque`, which get none, and `Sensor`: a tick
//! answers the newest.
//!
//! The first request carries the configuration, so one image serves every scenario.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::black_box::BlackBox;
use crate::counts::TorqueCounts;
use crate::frame::{ActuatorFrame, SensorFrame};
use crate::lapse::LapseCounts;
use crate::stored::StoredConfiguration;

/// Version of the messages' meaning, where their names do not show it, and of their encoding. New variants of
/// [`Request`] and [`Response`] are added at the end, so that a host and a board of different versions can still
/// compare this number and the hash of the build.
pub const PROTOCOL: u16 = 5;

/// Longest encoded message, in bytes: a configuration with a full reference.
pub const MAXIMUM_LENGTH: usize = 768;

/// Longest encoded response, in bytes.
pub const MAXIMUM_RESPONSE_LENGTH: usize = 192;

/// A request from the host to the board.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum Request<'a> {
    /// Starts afresh; answered by [`Response::Ready`], [`Response::Refused`], [`Response::RateRefused`] or
    /// [`Response::OtherBuild`].
    Configure {
        /// Hash of the host's build, see [`SchemaHash`](crate::schema::SchemaHash).
        build: u64,
        /// Source of the sensor frames.
        source: FrameSource,
        /// Configuration of the controller, encoded by postcard. The controller defines its type.
        configuration: &'a [u8],
    },
    /// Controls one tick of a simulated plant; answered by [`Response::Actuator`].
    Sensor(SensorFrame),
    /// Asks for the counters since the configuration; answered by [`Response::Health`].
    Health,
    /// Takes the torque off and drops the configuration; answered by [`Response::Stopped`].
    Stop,
    /// Reports that the host is present; no response. With [`FrameSource::Sensors`] the board stops
    /// if these requests cease.
    Alive,
    /// Asks for protocol and build; answered by [`Response::Identity`]. Changes nothing.
    Identify,
    /// Permits or forbids the drive to arm; answered by [`Response::Permission`]. The board's own switch
    /// must close as well. Every configuration and every stop of the drive withdraws the permission.
    PermitArming(bool),
    /// Asks for the record of the last reset, crash and fault; answered by [`Response::BlackBox`].
    BlackBox,
    /// Commands torques with [`FrameSource::Commissioning`]; no response. The board limits them by its
    /// configuration, and they expire after 50 ms unless they are repeated.
    Torque([TorqueCounts; 2]),
    /// Takes the torque off and stores a configuration, with which the board starts from then on, with
    /// [`FrameSource::StandAlone`]; answered by [`Response::Stored`], [`Response::Refused`],
    /// [`Response::RateRefused`] or [`Response::OtherBuild`].
    Store {
        /// Hash of the host's build, see [`SchemaHash`](crate::schema::SchemaHash).
        build: u64,
        /// Configuration of the controller, encoded by postcard.
        configuration: &'a [u8],
    },
    /// Takes the torque off and erases the stored configuration; answered by [`Response::Stored`].
    Forget,
    /// Asks for the stored configuration; answered by [`Response::Stored`]. Changes nothing.
    Stored,
    /// Asks for the hash of the sources; answered by [`Response::Sources`]. Changes nothing.
    Sources,
    /// Looks at a word of a board that drives nothing, or changes one; answered by [`Response::Probed`] or
    /// [`Response::Refused`]. After a store the board drives no arm until its next reset.
    Probe(Probe),
}

/// An access to the memory or a register of a bare board, for its acceptance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Probe {
    /// Loads a word. An address that does not answer resets the board.
    Load {
        /// Address of the word.
        address: u32,
    },
    /// Stores those bits of a word on which no torque depends; refused for a word without such bits.
    Store {
        /// Address of the word.
        address: u32,
        /// The word.
        value: u32,
    },
}

/// Source of a controller's sensor frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum FrameSource {
    /// The host, in [`Request::Sensor`]; it waits for every answer.
    Lockstep,
    /// The host, in real time: a tick of the board's timer without a frame is a lapse.
    Realtime,
    /// The board's own sensors, at every tick of its timer.
    Sensors,
    /// The same with the torque stages off, whatever the controller requests.
    DryRun,
    /// The same without a law: the host commands torques, by [`Request::Torque`], to commission the arm.
    Commissioning,
    /// The same as [`FrameSource::Sensors`] without a host, with the configuration that the board has stored:
    /// its own button permits the drive to arm.
    StandAlone,
}

impl FrameSource {
    /// Returns whether an arm is driven: whether the torque stages can come on.
    pub fn drives(self) -> bool {
        matches!(self, Self::Sensors | Self::Commissioning | Self::StandAlone)
    }

    /// Returns whether the board reads its own sensors.
    pub fn is_on_board(self) -> bool {
        !matches!(self, Self::Lockstep | Self::Realtime)
    }
}

/// A response from the board.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Response {
    /// The configuration is accepted and the control timer runs.
    Ready {
        /// Frequency of the stopwatch that times the ticks, Hz: the processor's clock on hardware,
        /// 10⁹ of virtual time under an emulator.
        stopwatch_hz: u32,
    },
    /// The request is refused: a configuration with a number out of range, or that cannot be decoded, or that would
    /// drive an arm after a probe has changed a register; or a probe while an arm is driven.
    Refused,
    /// The configuration comes from another build: its bytes may mean something else.
    OtherBuild {
        /// Hash of the board's build, see [`SchemaHash`](crate::schema::SchemaHash).
        build: u64,
    },
    /// The torque is off, and the configuration has been discarded.
    Stopped,
    /// The answer to a sensor frame.
    Actuator {
        /// The frame.
        frame: ActuatorFrame,
        /// Duration of the tick in counts of the board's stopwatch; 0 for an unrequested answer,
        /// which reports that a fault has taken the torque off.
        elapsed: u32,
    },
    /// Counters.
    Health(Health),
    /// The board's version.
    Identity {
        /// The board's [`PROTOCOL`].
        protocol: u16,
        /// Hash of the board's build, see [`SchemaHash`](crate::schema::SchemaHash).
        build: u64,
    },
    /// Whether the drive may arm: false without a configuration for the board's own sensors.
    Permission(bool),
    /// One tick on the board's own sensors.
    Tick {
        /// The board's readings.
        sensor: SensorFrame,
        /// The controller's answer to them.
        answer: ActuatorFrame,
        /// Duration of the tick in counts of the board's stopwatch.
        elapsed: u32,
    },
    /// The record of the last reset, crash and fault.
    BlackBox(BlackBox),
    /// The stored configuration.
    Stored(StoredConfiguration),
    /// Hash of the sources of the board's controller. Those of another program may behave differently.
    Sources(u64),
    /// The board's watchdogs have no limit for the control rate of the configuration.
    RateRefused(RefusedRate),
    /// The word of a [`Probe`], after it has been stored if it was.
    Probed {
        /// The word.
        value: u32,
        /// The board's stopwatch after the access.
        stopwatch: u32,
    },
}

/// A control rate for which a board's watchdogs have no limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct RefusedRate {
    /// The rate, Hz.
    pub tick_hz: u32,
    /// The nearest rate below that has a limit, Hz; 0 for none.
    pub below_hz: u32,
    /// The nearest rate above that has a limit, Hz; 0 for none.
    pub above_hz: u32,
}

/// Counters of a board since its configuration. Counters wrap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Health {
    /// Largest stack use since the start, bytes.
    pub stack_bytes: u32,
    /// Number of ticks controlled.
    pub ticks: u32,
    /// Answers discarded because the queue to the link was full.
    pub dropped_responses: u32,
    /// Lapses by kind.
    pub lapses: LapseCounts,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::black_box::{Crash, FILE_LENGTH, FaultRecord, ResetCause};
    use crate::counts::Micrometres;
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
        let black_box = BlackBox {
            reset: ResetCause::Pin,
            starts: u32::MAX,
            crash: Some(Crash::Panic {
                line: u32::MAX,
                file: [u8::MAX; FILE_LENGTH],
            }),
            fault: Some(FaultRecord {
                sensor: SensorFrame::LONGEST,
                answer: frame,
            }),
        };
        for response in [
            Response::BlackBox(black_box),
            Response::Tick {
                sensor: SensorFrame::LONGEST,
                answer: frame,
                elapsed,
            },
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

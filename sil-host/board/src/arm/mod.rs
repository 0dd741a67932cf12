//! A board that drives a real arm with its own sensors: the host monitors it, permits arming and
//! stops it.
//!
//! The controller runs on the board. The host sends heartbeats; the board stops after 200 ms
//! without one, and the host reports a board that has been silent for [`SILENCE_LIMIT`].

mod measured;

pub use measured::Measured;

use std::path::Path;
use std::time::{Duration, Instant};

use painleve_plant::Configuration;
use painleve_shared::black_box::BlackBox;
use painleve_shared::counts::TorqueCounts;
use painleve_shared::frame::{ActuatorFrame, SensorFrame};
use painleve_shared::message::{FrameSource, Health, Request, Response};

use crate::drivers::check_parts;
use crate::serial::PATIENCE;
use crate::{BoardError, ConnectedBoard, LineHealth, Serial};

/// Time between two heartbeats: three may be lost before the board stops.
const HEARTBEAT: Duration = Duration::from_millis(50);

/// Longest silence of a running board.
pub const SILENCE_LIMIT: Duration = Duration::from_millis(500);

/// Messages from a running board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ArmEvent {
    /// One control tick.
    Tick {
        /// The board's readings; `None` if a fault has removed the torque without any.
        sensor: Option<SensorFrame>,
        /// The controller's answer.
        answer: ActuatorFrame,
    },
    /// Whether the drive may arm.
    Permission(bool),
    /// The board's counters.
    Health(Health),
}

/// A board with an arm. Dropping it stops the drive, if the line still carries the request.
pub struct ConnectedArm {
    serial: Serial,
    /// The board's record of its last reset, crash and fault, as read at the start.
    pub black_box: BlackBox,
    /// Time of the last heartbeat.
    heartbeat: Instant,
    /// Time of the board's last message.
    heard: Instant,
}

impl ConnectedArm {
    /// Connects, compares protocol and build, and configures the board with one of the sources of frames that
    /// read its own sensors.
    ///
    /// # Errors
    /// [`BoardError::Port`], [`BoardError::InUse`], [`BoardError::Silent`], [`BoardError::NoFrames`],
    /// [`BoardError::OtherProtocol`], [`BoardError::OtherBuild`], [`BoardError::Parts`] or [`BoardError::Refused`].
    pub fn open(
        path: &Path,
        configuration: &Configuration,
        source: FrameSource,
    ) -> Result<Self, BoardError> {
        check_parts(configuration)?;
        let mut serial = Serial::connect(path)?;
        serial.identify()?;
        let black_box = serial.black_box()?;
        serial.configure(configuration, source)?;
        let now = Instant::now();
        Ok(Self {
            serial,
            black_box,
            heartbeat: now,
            heard: now,
        })
    }

    /// Returns whether the board was built from this program's sources.
    ///
    /// # Errors
    /// [`BoardError::OtherSources`] if it was not.
    pub fn compare_sources(&self) -> Result<(), BoardError> {
        self.serial.compare_sources()
    }

    /// Asks the board to permit or forbid arming; the answer is [`ArmEvent::Permission`]. The drive
    /// arms only after its switch has also been opened and closed.
    ///
    /// # Errors
    /// [`BoardError::System`] if the port fails.
    pub fn permit_arming(&mut self, permitted: bool) -> Result<(), BoardError> {
        self.serial.send(&Request::PermitArming(permitted))
    }

    /// Permits arming, and waits until the board has confirmed it. Skips ticks meanwhile.
    ///
    /// # Errors
    /// [`BoardError::Silent`] if the board does not answer.
    pub fn permit_arming_surely(&mut self) -> Result<(), BoardError> {
        let is_confirmed = |it: &Response| *it == Response::Permission(true);
        self.serial
            .ask(&Request::PermitArming(true), PATIENCE, is_confirmed)?;
        Ok(())
    }

    /// Commands raw torques; without effect unless the source is [`FrameSource::Commissioning`]. They
    /// expire after 50 ms unless they are repeated.
    ///
    /// # Errors
    /// [`BoardError::System`] if the port fails.
    pub fn command(&mut self, torques: [TorqueCounts; 2]) -> Result<(), BoardError> {
        self.heartbeat = Instant::now();
        self.serial.send(&Request::Torque(torques))
    }

    /// Requests the board's counters; the answer is [`ArmEvent::Health`].
    ///
    /// # Errors
    /// [`BoardError::System`] if the port fails.
    pub fn ask_for_health(&mut self) -> Result<(), BoardError> {
        self.serial.send(&Request::Health)
    }

    /// Waits for the board's next message for at most `limit`, and sends heartbeats meanwhile.
    /// Returns `None` if no message arrives.
    ///
    /// # Errors
    /// [`BoardError::Silent`] or [`BoardError::NoFrames`] if the board has been silent for
    /// [`SILENCE_LIMIT`], [`BoardError::Unplugged`] and [`BoardError::System`] if the port fails.
    pub fn next_event(&mut self, limit: Duration) -> Result<Option<ArmEvent>, BoardError> {
        let start = Instant::now();
        loop {
            if self.heartbeat.elapsed() >= HEARTBEAT {
                self.heartbeat = Instant::now();
                self.serial.send(&Request::Alive)?;
            }
            let left = limit.saturating_sub(start.elapsed()).min(HEARTBEAT);
            let Some(response) = self.serial.listen(left)? else {
                if self.heard.elapsed() > SILENCE_LIMIT {
                    return Err(self.serial.silence(self.heard.elapsed()));
                }
                if start.elapsed() >= limit {
                    return Ok(None);
                }
                continue;
            };
            self.heard = Instant::now();
            return Ok(Some(match response {
                Response::Tick { sensor, answer, .. } => ArmEvent::Tick {
                    sensor: Some(sensor),
                    answer,
                },
                Response::Actuator { frame, .. } => ArmEvent::Tick {
                    sensor: None,
                    answer: frame,
                },
                Response::Permission(permitted) => ArmEvent::Permission(permitted),
                Response::Health(health) => ArmEvent::Health(health),
                _ if start.elapsed() >= limit => return Ok(None),
                _ => continue,
            }));
        }
    }

    /// Returns the disturbances of the line, as this host has counted them.
    pub fn line(&self) -> LineHealth {
        self.serial.line().unwrap_or_default()
    }

    /// Removes the torque, and waits until the board has confirmed it.
    ///
    /// # Errors
    /// [`BoardError::Silent`] if the board does not answer.
    pub fn stop(&mut self) -> Result<(), BoardError> {
        self.serial.stop()
    }
}

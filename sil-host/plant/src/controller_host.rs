//! The host of the controller, as the closed loop sees it.
//!
//! [`InProcess`] is a library call, for studies and tests. Hosts in other processes and on boards
//! are in separate crates.

use std::time::Duration;

use painleve_shared::frame::{ActuatorFrame, SensorFrame};
use painleve_shared::range::OutOfRange;

use crate::{Configuration, Controller};

/// The answer to one sensor frame.
#[derive(Clone, Copy, Debug, Default)]
pub struct Answer {
    /// The controller's frame; `None` if it did not arrive in time.
    pub frame: Option<ActuatorFrame>,
    /// Time from sending the sensor frame to receiving its answer; `None` if it did not arrive in time, and for a library
    /// call.
    pub round_trip: Option<Duration>,
}

/// Failure of a host, with the host's own error as the reason.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
pub struct HostError(Box<dyn std::error::Error + Send + Sync>);

impl HostError {
    /// Wraps the error of a particular host.
    pub fn new(reason: impl std::error::Error + Send + Sync + 'static) -> Self {
        Self(Box::new(reason))
    }
}

/// A host of the controller, which answers sensor frames.
pub trait ControllerHost {
    /// Sends one frame and waits for its answer or the end of the tick.
    ///
    /// # Errors
    /// [`HostError`] if the controller is no longer available.
    fn exchange(&mut self, frame: &SensorFrame) -> Result<Answer, HostError>;

    /// Lets a tick pass whose frame is lost. In real time it lasts as long as any other.
    ///
    /// # Errors
    /// As [`ControllerHost::exchange`].
    fn skip(&mut self) -> Result<Answer, HostError> {
        Ok(Answer::default())
    }
}

/// The controller in this process.
pub struct InProcess {
    controller: Controller,
}

impl InProcess {
    /// Creates a controller with this configuration.
    ///
    /// # Errors
    /// [`OutOfRange`] naming the first key that is out of range.
    pub fn new(configuration: &Configuration) -> Result<Self, OutOfRange> {
        Ok(Self {
            controller: Controller::new(configuration)?,
        })
    }
}

impl ControllerHost for InProcess {
    #[inline]
    fn exchange(&mut self, frame: &SensorFrame) -> Result<Answer, HostError> {
        Ok(Answer {
            frame: Some(self.controller.tick(frame)),
            // Reading the clock twice would cost a tenth of a tick.
            round_trip: None,
        })
    }
}

//! Whatever runs the controller, as the closed loop sees it.
//!
//! - [`InProcess`]: a library call, for studies and tests
//! - [`OnBoard`]: the image on a board, without a link
//! - [`lockstep`]: another process over the link, tick by tick
//! - [`paced`]: another process over the link, by the clock

pub mod lockstep;
pub mod paced;

use std::time::{Duration, Instant};

use painleve_firmware::{Configuration, Controller};
use painleve_shared::frame::{ActuatorFrame, SensorFrame};
use painleve_shared::range::OutOfRange;

use crate::board::{Board, BoardError};
use crate::link::LinkError;
use crate::timing::TickTimes;

/// The answer to one sensor frame.
#[derive(Clone, Copy, Debug)]
pub struct Answer {
    /// The controller's frame; `None` if it did not come in time.
    pub frame: Option<ActuatorFrame>,
    /// Time from sending the sensor frame to having the answer.
    pub round_trip: Duration,
}

/// Why there are no answers any more.
#[derive(Debug, thiserror::Error)]
pub enum HostError {
    /// The controller is gone.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The board does not answer.
    #[error(transparent)]
    Board(#[from] BoardError),
    /// The clock cannot be waited on.
    #[error("cannot wait on the monotonic clock: {0}")]
    Clock(std::io::Error),
}

/// Something that answers sensor frames.
pub trait ControllerHost {
    /// Sends one frame and waits for its answer or the end of the tick.
    ///
    /// # Errors
    /// [`HostError`] if there is no controller to answer any more.
    fn exchange(&mut self, frame: &SensorFrame) -> Result<Answer, HostError>;
}

/// The controller in this very process.
pub struct InProcess {
    controller: Controller,
}

impl InProcess {
    /// A controller with this configuration.
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
    fn exchange(&mut self, frame: &SensorFrame) -> Result<Answer, HostError> {
        let start = Instant::now();
        let answer = self.controller.tick(frame);
        Ok(Answer {
            frame: Some(answer),
            round_trip: start.elapsed(),
        })
    }
}

/// The controller on a board that belongs to this process.
pub struct OnBoard<B> {
    /// The board.
    pub board: B,
    /// What its ticks have cost.
    pub times: TickTimes,
}

impl<B> OnBoard<B> {
    /// A board that has its configuration.
    pub fn new(board: B) -> Self {
        Self {
            board,
            times: TickTimes::default(),
        }
    }
}

impl<B: Board> ControllerHost for OnBoard<B> {
    fn exchange(&mut self, frame: &SensorFrame) -> Result<Answer, HostError> {
        let start = Instant::now();
        let answer = self.board.exchange(frame)?;
        let round_trip = start.elapsed();
        self.times.push(&answer.frame, answer.cost);
        Ok(Answer {
            frame: Some(answer.frame),
            round_trip,
        })
    }
}

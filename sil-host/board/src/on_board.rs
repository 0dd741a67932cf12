//! A board of this process as the controller of a closed loop.

use std::time::Instant;

use painleve_plant::controller_host::{Answer, ControllerHost, HostError};
use painleve_shared::frame::SensorFrame;

use crate::ConnectedBoard;
use crate::timing::TickTimes;

/// The controller on a board of this process.
pub struct OnBoard<B> {
    /// The board.
    pub board: B,
    /// Costs of its ticks.
    pub times: TickTimes,
}

impl<B> OnBoard<B> {
    /// Takes a configured board.
    pub fn new(board: B) -> Self {
        Self {
            board,
            times: TickTimes::default(),
        }
    }
}

impl<B: ConnectedBoard> ControllerHost for OnBoard<B> {
    fn exchange(&mut self, frame: &SensorFrame) -> Result<Answer, HostError> {
        let start = Instant::now();
        let answer = self.board.exchange(frame).map_err(HostError::new)?;
        let round_trip = start.elapsed();
        self.times.push(&answer.frame, answer.cost);
        Ok(Answer {
            frame: Some(answer.frame),
            round_trip: Some(round_trip),
        })
    }
}

//! A board that belongs to this process, as the closed loop sees it.

use std::time::Instant;

use painleve_plant::controller_host::{Answer, ControllerHost, HostError};
use painleve_shared::frame::SensorFrame;

use crate::ConnectedBoard;
use crate::timing::TickTimes;

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

impl<B: ConnectedBoard> ControllerHost for OnBoard<B> {
    fn exchange(&mut self, frame: &SensorFrame) -> Result<Answer, HostError> {
        let start = Instant::now();
        let answer = self.board.exchange(frame).map_err(HostError::new)?;
        let round_trip = start.elapsed();
        self.times.push(&answer.frame, answer.cost);
        Ok(Answer {
            frame: Some(answer.frame),
            round_trip,
        })
    }
}

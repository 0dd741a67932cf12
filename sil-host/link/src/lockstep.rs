//! A controller in another process, in lockstep: the plant waits for every answer.

use std::time::{Duration, Instant};

use painleve_plant::controller_host::{Answer, ControllerHost, HostError};
use painleve_shared::frame::SensorFrame;

use crate::PlantEnd;

/// The plant's end of the link as a lockstep controller.
pub struct Lockstep {
    /// The link.
    pub end: PlantEnd,
    /// Time that a tick takes whose frame is lost: the period of a board that keeps the time; otherwise zero.
    pub skip: Duration,
}

impl ControllerHost for Lockstep {
    fn exchange(&mut self, frame: &SensorFrame) -> Result<Answer, HostError> {
        let start = Instant::now();
        let answer = self.end.exchange(frame).map_err(HostError::new)?;
        Ok(Answer {
            frame: Some(answer),
            round_trip: Some(start.elapsed()),
        })
    }

    fn skip(&mut self) -> Result<Answer, HostError> {
        std::thread::sleep(self.skip);
        Ok(Answer::default())
    }
}

//! A controller in another process, in lockstep: the plant waits for every answer.

use std::time::Instant;

use painleve_plant::controller_host::{Answer, ControllerHost, HostError};
use painleve_shared::frame::SensorFrame;

use crate::PlantEnd;

/// The plant's end of the link as a lockstep controller.
pub struct Lockstep(pub PlantEnd);

impl ControllerHost for Lockstep {
    fn exchange(&mut self, frame: &SensorFrame) -> Result<Answer, HostError> {
        let start = Instant::now();
        let answer = self.0.exchange(frame).map_err(HostError::new)?;
        Ok(Answer {
            frame: Some(answer),
            round_trip: start.elapsed(),
        })
    }
}

//! The controller's estimates, recomputed from the recorded frames.
//!
//! The controller's answers carry torque counts, state and flags, but not its estimates. The
//! controller is deterministic and gives the same bits on every host, so a second controller that
//! receives the same frames has the same estimates, wherever the first one runs. Its answers are
//! compared with the recorded ones at every tick. If they differ, the other controller is not of
//! this build or has lost ticks in real time, and its estimates are unknown.

use painleve_plant::sample::Sample;
use painleve_plant::telemetry::Telemetry;
use painleve_plant::{Configuration, Controller};
use painleve_shared::frame::ActuatorFrame;

/// A second controller that follows the recorded one.
#[derive(Clone, Debug)]
pub struct Replica {
    controller: Controller,
    telemetry: Telemetry,
}

impl Replica {
    /// Builds the replica of a controller with this configuration; `None` if it is invalid.
    pub fn new(configuration: &Configuration) -> Option<Self> {
        Some(Self {
            controller: Controller::new(configuration).ok()?,
            telemetry: Telemetry::default(),
        })
    }

    /// Runs the tick of a sample. Returns whether the answer agrees with the recorded one, if there
    /// is one.
    pub fn follow(&mut self, sample: &Sample) -> bool {
        if !sample.delivered {
            return true;
        }
        let answer = self.telemetry.tick(&mut self.controller, &sample.sensor);
        !sample.answered || essence(&answer) == essence(&sample.actuator)
    }

    /// Returns the controller's internal state after the last tick that it received.
    pub fn telemetry(&self) -> &Telemetry {
        &self.telemetry
    }
}

/// Returns the part of an answer that distinguishes controllers.
fn essence(answer: &ActuatorFrame) -> impl PartialEq {
    (answer.torques, answer.state, answer.fault, answer.flags)
}

//! One control tick for records: a [`Sample`].

use painleve_shared::status::SupervisorState;
use painleve_shared::{ActuatorFrame, SensorFrame};

use crate::plant::Snapshot;

/// Returns the reference z_t* that the controller follows, m; NaN while it follows none.
pub fn reference_tip_t_m(answer: &ActuatorFrame) -> f64 {
    let follows = answer
        .supervisor_state()
        .is_some_and(SupervisorState::drives);
    if follows {
        answer.reference_tip.to_metres()
    } else {
        f64::NAN
    }
}

/// Both frames of a control tick and the plant's true state.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// The plant when the sensors are read, before the answer takes effect.
    pub plant: Snapshot,
    /// Frame sent to the controller.
    pub sensor: SensorFrame,
    /// Frame of the controller's answer.
    pub actuator: ActuatorFrame,
    /// Reference z_t*, m; NaN while the controller follows no reference.
    pub reference_tip_t_m: f64,
    /// Whether the controller received the sensor frame.
    pub delivered: bool,
    /// Whether the controller answered in time; otherwise `actuator` is its last answer.
    pub answered: bool,
}

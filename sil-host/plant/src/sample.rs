//! One control tick for records: a [`Sample`].

use painleve_shared::{ActuatorFrame, SensorFrame};

use crate::plant::Snapshot;

/// Both frames of a control tick and the truth behind them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// The plant at the instant the sensors are read, before the answer acts.
    pub plant: Snapshot,
    /// What the controller was told.
    pub sensor: SensorFrame,
    /// What it answered.
    pub actuator: ActuatorFrame,
    /// Reference z_t*, m; NaN while the controller follows none.
    pub reference_tip_t_m: f64,
}

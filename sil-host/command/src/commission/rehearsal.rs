//! A simulated arm whose operator's tasks are shown.

use painleve_commission::simulated::{SimulatedError, SimulatedRig};
use painleve_commission::{OperatorTask, RawReadings, Rig};
use painleve_process::terminal::warn;
use painleve_shared::counts::TorqueCounts;

/// Shows the operator's tasks of a rehearsal.
pub struct Rehearsal(pub SimulatedRig);

impl Rig for Rehearsal {
    type Error = SimulatedError;

    fn instruct(&mut self, instruction: OperatorTask) -> Result<(), SimulatedError> {
        warn(format_args!("operator: {instruction}"));
        self.0.instruct(instruction)
    }

    fn exchange(&mut self, torques: [TorqueCounts; 2]) -> Result<RawReadings, SimulatedError> {
        self.0.exchange(torques)
    }
}

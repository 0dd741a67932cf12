//! Events and counters of the control task, for the log and the host.

use painleve_firmware::drive::{ControlTask, Drive};
use painleve_firmware::law::Law;
use painleve_firmware::supervise::lapses::{LapseCounts, LapseMonitor};
use painleve_shared::frame::ActuatorFrame;
use painleve_shared::message::Health;
use painleve_shared::status::{Fault, SupervisorState};

/// State of the control task, as logged.
#[derive(Clone, Copy, PartialEq)]
pub struct Change {
    /// The supervisor's state.
    pub state: SupervisorState,
    /// The latched fault.
    pub fault: Option<Fault>,
}

impl Change {
    /// Returns the state before the first answer.
    pub const NONE: Self = Self {
        state: SupervisorState::Idle,
        fault: None,
    };

    /// Returns whether an answer is in this state, by the numbers that cross the link.
    pub fn is_of(&self, answer: &ActuatorFrame) -> bool {
        let fault = self.fault.map_or(0, |fault| fault as u8);
        answer.state == self.state as u8 && answer.fault == fault
    }

    /// Returns the state in the newest answer.
    pub fn of(answer: &ActuatorFrame) -> Self {
        Self {
            state: answer.supervisor_state().unwrap_or_default(),
            fault: answer.latched_fault(),
        }
    }
}

/// Returns every counter except the stack; `dropped_responses` is the number of answers discarded
/// because the queue to the link was full.
pub fn health<D: Drive, L: Law>(task: &ControlTask<D, L>, dropped_responses: u32) -> Health {
    Health {
        stack_bytes: 0,
        ticks: task.counts().ticks,
        dropped_responses,
        lapses: task
            .lapses()
            .map_or_else(LapseCounts::default, LapseMonitor::totals),
    }
}

//! Events and counters of the control task, for the log and the host.

use painleve_firmware::drive::Drive;
use painleve_firmware::law::Law;
use painleve_firmware::supervise::lapses::{LapseCounts, LapseMonitor};
use painleve_shared::frame::ActuatorFrame;
use painleve_shared::message::Health;
use painleve_shared::status::{Fault, SupervisorState};

use crate::tasks::Control;

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

    /// Returns the state in the newest answer.
    pub fn of(answer: &ActuatorFrame) -> Self {
        Self {
            state: answer.supervisor_state().unwrap_or_default(),
            fault: answer.latched_fault(),
        }
    }
}

/// Returns every counter except the stack.
pub fn health<D: Drive, L: Law>(control: &Control<D, L>) -> Health {
    let Control {
        task,
        dropped_responses,
        ..
    } = control;
    Health {
        stack_bytes: 0,
        ticks: task.counts().ticks,
        dropped_responses: *dropped_responses,
        lapses: task
            .lapse_counts()
            .map_or_else(LapseCounts::default, LapseMonitor::totals),
    }
}

//! What is counted between two configurations, for the host and for the log.

use painleve_firmware::Controller;
use painleve_firmware::supervise::lapses::LapseCounts;
use painleve_shared::frame::ActuatorFrame;
use painleve_shared::message::{Health, Plant};
use painleve_shared::status::{Fault, SupervisorState};

/// What the log hears of the control task.
#[derive(Clone, Copy, PartialEq)]
pub struct Change {
    /// The supervisor's state.
    pub state: SupervisorState,
    /// The latched fault.
    pub fault: Option<Fault>,
}

impl Change {
    /// Nothing has happened yet.
    pub const NONE: Self = Self {
        state: SupervisorState::Idle,
        fault: None,
    };

    /// How things are by the newest answer.
    pub fn of(answer: &ActuatorFrame) -> Self {
        Self {
            state: answer.supervisor_state().unwrap_or_default(),
            fault: answer.latched_fault(),
        }
    }
}

/// What is counted besides the controller's lapses.
pub struct Watch {
    /// Where sensor frames come from.
    pub plant: Plant,
    /// Ticks controlled.
    pub ticks: u32,
    /// Ticks a second.
    pub tick_hz: u32,
    /// Longest tick, in counts of the stopwatch.
    pub worst_elapsed: u32,
    /// Answers for which the link had no room.
    pub dropped_responses: u32,
}

impl Watch {
    /// Nothing counted.
    pub const fn new(plant: Plant, tick_hz: u32) -> Self {
        Self {
            plant,
            ticks: 0,
            tick_hz,
            worst_elapsed: 0,
            dropped_responses: 0,
        }
    }

    /// Takes note of a tick.
    pub fn tick(&mut self, elapsed: u32) {
        self.ticks = self.ticks.wrapping_add(1);
        self.worst_elapsed = self.worst_elapsed.max(elapsed);
    }

    /// Every counter, except the stack: looking at that takes too long to hold up the control task.
    pub fn health(&self, controller: Option<&Controller>) -> Health {
        Health {
            stack_bytes: 0,
            ticks: self.ticks,
            dropped_responses: self.dropped_responses,
            lapses: controller.map_or_else(LapseCounts::default, |controller| {
                controller.lapse_counts().totals()
            }),
        }
    }
}

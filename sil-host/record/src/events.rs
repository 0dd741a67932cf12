//! Events of a run: discontinuities of the plant's motion and changes of the controller's state.

use painleve_plant::{ContactMode, Event};
use painleve_shared::ActuatorFrame;
use painleve_shared::frame::StatusFlags;
use painleve_shared::status::{Fault, SupervisorState};

/// An event at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunEvent {
    /// Simulated time, s.
    pub time_s: f64,
    /// Kind of event.
    pub kind: EventKind,
}

/// Kind of event, with its details.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum EventKind {
    /// A discontinuity of the plant's motion.
    Plant(Event),
    /// The controller's supervisor changed its state.
    State {
        /// The state before.
        from: SupervisorState,
        /// The state after.
        to: SupervisorState,
    },
    /// The controller latched a fault.
    Fault(Fault),
    /// The controller holds its reference at the edge of the admissible stretch, or no longer does.
    Edge {
        /// Whether it is held.
        held: bool,
    },
    /// The controller returns the tip to the belt, or has stopped doing so.
    Recovery {
        /// Whether it is in progress.
        active: bool,
    },
    /// The estimates are unknown from here on: the answers are not those of this build's
    /// controller, or ticks were lost in real time.
    EstimatesEnd,
}

impl EventKind {
    /// Returns the kind's name, as in files.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Plant(Event::Impact { .. }) => "impact",
            Self::Plant(Event::ImpactWithoutCollision { .. }) => "impact-without-collision",
            Self::Plant(Event::ModeChange {
                to: ContactMode::Flight,
                ..
            }) => "lift-off",
            Self::Plant(Event::ModeChange { .. }) => "mode",
            Self::State { .. } => "state",
            Self::Fault(_) => "fault",
            Self::Edge { .. } => "edge",
            Self::Recovery { .. } => "recovery",
            Self::EstimatesEnd => "estimates-end",
        }
    }

    /// Returns the event in words.
    pub fn describe(&self) -> String {
        match self {
            Self::Plant(Event::Impact {
                approach_m_s,
                impulse_ns: [_, normal],
            }) => format!("impact at {approach_m_s:.4} m/s, normal impulse {normal:.4} N·s"),
            Self::Plant(Event::ImpactWithoutCollision {
                impulse_ns: [_, normal],
            }) => format!("impact without collision, normal impulse {normal:.4} N·s"),
            Self::Plant(Event::ModeChange {
                from,
                to: ContactMode::Flight,
            }) => format!("lift-off from {}", from.name()),
            Self::Plant(Event::ModeChange { from, to }) => {
                format!("{} to {}", from.name(), to.name())
            }
            Self::State { from, to } => format!("controller: {} to {}", from.name(), to.name()),
            Self::Fault(fault) => format!("fault {}: {}", *fault as u8, fault.description()),
            Self::Edge { held: true } => "reference held at the edge".into(),
            Self::Edge { held: false } => "reference released from the edge".into(),
            Self::Recovery { active: true } => "recovery starts".into(),
            Self::Recovery { active: false } => "recovery ends".into(),
            Self::EstimatesEnd => "the controller is not this build's, or lost ticks: its \
                                   estimates are not known from here on"
                .into(),
        }
    }

    /// Returns the impulse of the belt on the tip, (P_t, P_n), N·s, if there was one.
    pub fn impulse_ns(&self) -> Option<[f64; 2]> {
        match self {
            Self::Plant(
                Event::Impact { impulse_ns, .. } | Event::ImpactWithoutCollision { impulse_ns },
            ) => Some(*impulse_ns),
            _ => None,
        }
    }

    /// Returns the names of mode or state before and after, where the event changes one.
    pub fn change(&self) -> Option<(&'static str, &'static str)> {
        match self {
            Self::Plant(Event::ModeChange { from, to }) => Some((from.name(), to.name())),
            Self::State { from, to } => Some((from.name(), to.name())),
            _ => None,
        }
    }
}

/// Finds events in the controller's answers.
#[derive(Clone, Debug, Default)]
pub struct ControllerEvents {
    state: SupervisorState,
    fault: Option<Fault>,
    flags: StatusFlags,
}

impl ControllerEvents {
    /// Returns the changes since the last answer.
    pub fn take_in(&mut self, answer: &ActuatorFrame) -> [Option<EventKind>; 4] {
        let before = self.clone();
        self.state = answer.supervisor_state().unwrap_or(before.state);
        self.fault = answer.latched_fault();
        self.flags = answer.flags;
        let changed = self.flags ^ before.flags;
        let flag = |flag| {
            changed
                .contains(flag)
                .then_some(answer.flags.contains(flag))
        };
        [
            (self.state != before.state).then_some(EventKind::State {
                from: before.state,
                to: self.state,
            }),
            self.fault
                .filter(|fault| before.fault != Some(*fault))
                .map(EventKind::Fault),
            flag(StatusFlags::AT_EDGE).map(|held| EventKind::Edge { held }),
            flag(StatusFlags::RECOVERING).map(|active| EventKind::Recovery { active }),
        ]
    }
}

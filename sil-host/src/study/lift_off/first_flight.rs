//! The first flight from an instant on, at the plant's own resolution.

use crate::plant::motion::State;
use crate::plant::{Event, Observer, PlantStep};

/// Watches for the first flight.
#[derive(Clone, Copy, Debug)]
pub(super) struct FirstFlight {
    from_s: f64,
    /// When it began, s.
    pub(super) start_s: Option<f64>,
    /// When the tip touched again, s.
    pub(super) end_s: Option<f64>,
}

impl FirstFlight {
    /// Watches from `from_s` on.
    pub(super) fn new(from_s: f64) -> Self {
        Self {
            from_s,
            start_s: None,
            end_s: None,
        }
    }
}

impl Observer for FirstFlight {
    fn step(&mut self, step: &PlantStep<'_>) {
        if step.start_s < self.from_s {
            return;
        }
        match (step.mode.is_contact(), self.start_s) {
            (false, None) => self.start_s = Some(step.start_s),
            (true, Some(_)) => {
                self.end_s.get_or_insert(step.start_s);
            }
            _ => {}
        }
    }

    fn event(&mut self, time_s: f64, event: Event, _: &State) {
        let touch = matches!(event, Event::Impact { .. } | Event::ImpactWithoutCollision);
        if touch && self.start_s.is_some_and(|start_s| start_s < time_s) {
            self.end_s.get_or_insert(time_s);
        }
    }
}

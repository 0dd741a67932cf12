//! The first sufficiently long flight, at the plant's own resolution.

use painleve_plant::{Event, Probe, State, Step};

/// Observes the first flight that is long enough to be detected in time.
#[derive(Clone, Copy, Debug)]
pub(super) struct FirstFlight {
    from_s: f64,
    shortest_s: f64,
    /// Start of that flight, or of a shorter one before it, s.
    pub(super) start_s: Option<f64>,
    /// Time at which the tip touched the belt again, s.
    pub(super) end_s: Option<f64>,
}

impl FirstFlight {
    /// Starts observing at `from_s` for a flight longer than `shortest_s`.
    pub(super) fn new(from_s: f64, shortest_s: f64) -> Self {
        Self {
            from_s,
            shortest_s,
            start_s: None,
            end_s: None,
        }
    }

    /// Whether a sufficiently long flight has ended.
    pub(super) fn is_over(&self) -> bool {
        self.end_s
            .zip(self.start_s)
            .is_some_and(|(end_s, start_s)| end_s - start_s > self.shortest_s)
    }

    /// Records a lift-off, in place of an earlier flight that was too short.
    fn leaves(&mut self, time_s: f64) {
        if self.start_s.is_none() || (self.end_s.is_some() && !self.is_over()) {
            self.start_s = Some(time_s);
            self.end_s = None;
        }
    }
}

impl Probe for FirstFlight {
    fn step(&mut self, step: &dyn Step) {
        if step.start_s() < self.from_s {
            return;
        }
        match (step.mode().is_contact(), self.start_s) {
            (false, _) => self.leaves(step.start_s()),
            (true, Some(_)) => {
                self.end_s.get_or_insert(step.start_s());
            }
            _ => {}
        }
    }

    fn event(&mut self, time_s: f64, event: Event, _: &State) {
        let touch = matches!(
            event,
            Event::Impact { .. } | Event::ImpactWithoutCollision { .. }
        );
        if touch && self.start_s.is_some_and(|start_s| start_s < time_s) {
            self.end_s.get_or_insert(time_s);
        }
    }
}

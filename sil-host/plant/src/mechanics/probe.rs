//! Observation of the arm's motion on its belt together with its equations.

use crate::plant::{ContactMode, Event, Probe, Snapshot, State, Step};

use super::motion::{Evaluation, Motion};

/// One accepted step of the arm on its belt.
#[derive(Clone, Copy, Debug)]
pub struct ArmStep<'a> {
    /// The equations of the step.
    pub motion: &'a Motion<'a>,
    /// The contact mode during the step.
    pub mode: ContactMode,
    /// Start time, s.
    pub start_s: f64,
    /// State at the start.
    pub start: &'a State,
    /// The equations evaluated at the start.
    pub at_start: &'a Evaluation,
    /// End time, s.
    pub end_s: f64,
    /// State at the end.
    pub end: &'a State,
    /// The equations evaluated at the end, still in this mode.
    pub at_end: &'a Evaluation,
}

/// Observes the motion of the arm on its belt together with its equations.
pub trait ArmProbe {
    /// Called after every accepted step.
    fn step(&mut self, step: &ArmStep<'_>);
    /// Called at every discontinuity; `state` is the state after it.
    fn event(&mut self, time_s: f64, event: Event, state: &State);
}

/// A probe for any plant also observes this one.
impl<P: Probe> ArmProbe for P {
    #[inline]
    fn step(&mut self, step: &ArmStep<'_>) {
        Probe::step(self, step);
    }

    fn event(&mut self, time_s: f64, event: Event, state: &State) {
        Probe::event(self, time_s, event, state);
    }
}

impl Step for ArmStep<'_> {
    #[inline]
    fn start_s(&self) -> f64 {
        self.start_s
    }

    #[inline]
    fn end_s(&self) -> f64 {
        self.end_s
    }

    #[inline]
    fn mode(&self) -> ContactMode {
        self.mode
    }

    #[inline]
    fn start(&self) -> Snapshot {
        self.motion
            .snapshot_of(self.mode, self.start_s, self.start, self.at_start)
    }

    #[inline]
    fn end(&self) -> Snapshot {
        self.motion
            .snapshot_of(self.mode, self.end_s, self.end, self.at_end)
    }
}

//! Seeing the motion of a plant at its own resolution, between the ticks of the controller.

use super::{ContactMode, Snapshot, State};

/// A discontinuity of the motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// The tip hit the belt with this normal velocity (m/s, negative).
    Impact {
        /// Normal velocity before, m/s.
        approach_m_s: f64,
    },
    /// The tip was thrown off out of sliding although nothing collided.
    ImpactWithoutCollision,
    /// The mode changed.
    ModeChange {
        /// Mode before.
        from: ContactMode,
        /// Mode after.
        to: ContactMode,
    },
}

/// A stretch of smooth motion in one contact mode. Values are computed when asked for.
pub trait Step {
    /// Start time, s.
    fn start_s(&self) -> f64;
    /// End time, s.
    fn end_s(&self) -> f64;
    /// What held the tip.
    fn mode(&self) -> ContactMode;
    /// The plant at the start.
    fn start(&self) -> Snapshot;
    /// The plant at the end, before any discontinuity there.
    fn end(&self) -> Snapshot;
}

/// Sees the motion of a plant at the plant's own resolution.
pub trait Probe {
    /// Called after every step.
    fn step(&mut self, step: &impl Step);
    /// Called at every discontinuity; `state` is the one after it.
    fn event(&mut self, time_s: f64, event: Event, state: &State);
}

/// Sees nothing.
impl Probe for () {
    fn step(&mut self, _: &impl Step) {}
    fn event(&mut self, _: f64, _: Event, _: &State) {}
}

/// Two probes at once, the first one first.
impl<A: Probe, B: Probe> Probe for (&mut A, &mut B) {
    fn step(&mut self, step: &impl Step) {
        self.0.step(step);
        self.1.step(step);
    }

    fn event(&mut self, time_s: f64, event: Event, state: &State) {
        self.0.event(time_s, event, state);
        self.1.event(time_s, event, state);
    }
}

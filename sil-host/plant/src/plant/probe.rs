//! Observation of a plant's motion at its own resolution, between the ticks of the controller.

use super::{ContactMode, Snapshot, State};

/// A discontinuity of the motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// The tip hit the belt with this normal velocity (m/s, negative).
    Impact {
        /// Normal velocity before, m/s.
        approach_m_s: f64,
        /// Impulse of the belt on the tip, (P_t, P_n), N·s.
        impulse_ns: [f64; 2],
    },
    /// The tip was thrown off while sliding, without a collision.
    ImpactWithoutCollision {
        /// Impulse of the belt on the tip, (P_t, P_n), N·s.
        impulse_ns: [f64; 2],
    },
    /// The mode changed.
    ModeChange {
        /// Mode before.
        from: ContactMode,
        /// Mode after.
        to: ContactMode,
    },
}

/// A stretch of smooth motion in one contact mode. Values are computed on request.
pub trait Step {
    /// Returns the start time, s.
    fn start_s(&self) -> f64;
    /// Returns the end time, s.
    fn end_s(&self) -> f64;
    /// Returns the contact mode during the step.
    fn mode(&self) -> ContactMode;
    /// Returns the plant at the start.
    fn start(&self) -> Snapshot;
    /// Returns the plant at the end, before any discontinuity there.
    fn end(&self) -> Snapshot;
}

/// Observes the motion of a plant at the plant's own resolution.
pub trait Probe {
    /// Called after every step.
    fn step(&mut self, step: &dyn Step);
    /// Called at every discontinuity; `state` is the state after it.
    fn event(&mut self, time_s: f64, event: Event, state: &State);
}

/// Ignores everything.
impl Probe for () {
    fn step(&mut self, _: &dyn Step) {}
    fn event(&mut self, _: f64, _: Event, _: &State) {}
}

/// The probe behind a reference.
impl<P: Probe + ?Sized> Probe for &mut P {
    fn step(&mut self, step: &dyn Step) {
        (**self).step(step);
    }

    fn event(&mut self, time_s: f64, event: Event, state: &State) {
        (**self).event(time_s, event, state);
    }
}

/// Two probes, called in order.
impl<A: Probe, B: Probe> Probe for (A, B) {
    fn step(&mut self, step: &dyn Step) {
        self.0.step(step);
        self.1.step(step);
    }

    fn event(&mut self, time_s: f64, event: Event, state: &State) {
        self.0.event(time_s, event, state);
        self.1.event(time_s, event, state);
    }
}

//! Contact and flight from a given instant, at the plant's own resolution.

use crate::plant::{Event, Probe, State, Step};

/// Shortest contact that counts as a capture, s.
pub const CAPTURE_S: f64 = 0.1;

/// Observes when the tip is captured, and whether it leaves the belt again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactProbe {
    from_s: f64,
    hold_s: f64,
    contact_since_s: Option<f64>,
    /// Start of the first contact that lasted for the holding time, s.
    pub captured_s: Option<f64>,
    /// End of the last flight, s; the start of the observation if there was none.
    pub last_flight_end_s: f64,
    /// Number of lift-offs after the capture.
    pub lift_offs: u64,
    /// Time of the first of them, s.
    pub first_lift_off_s: Option<f64>,
}

impl ContactProbe {
    /// Starts observing at `from_s`; a contact that lasts for `hold_s` is a capture.
    pub fn new(from_s: f64, hold_s: f64) -> Self {
        Self {
            from_s,
            hold_s,
            contact_since_s: None,
            captured_s: None,
            last_flight_end_s: from_s,
            lift_offs: 0,
            first_lift_off_s: None,
        }
    }

    /// Whether the tip touches the belt.
    pub fn touches(&self) -> bool {
        self.contact_since_s.is_some()
    }
}

impl Probe for ContactProbe {
    fn step(&mut self, step: &dyn Step) {
        if step.end_s() <= self.from_s {
            return;
        }
        if step.mode().is_contact() {
            let start_s = step.start_s().max(self.from_s);
            let since_s = *self.contact_since_s.get_or_insert(start_s);
            if self.captured_s.is_none() && step.end_s() - since_s >= self.hold_s {
                self.captured_s = Some(since_s);
            }
            return;
        }
        if self.contact_since_s.take().is_some() && self.captured_s.is_some() {
            self.lift_offs += 1;
            self.first_lift_off_s.get_or_insert(step.start_s());
        }
        self.last_flight_end_s = step.end_s();
    }

    fn event(&mut self, _: f64, _: Event, _: &State) {}
}

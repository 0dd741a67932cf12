//! Contact that is taken for flight.

use painleve_shared::frame::StatusFlags;

use crate::contact_watch::ContactWatch;
use crate::trial::Trial;

/// Counts how often the controller gives up a contact that lasts.
#[derive(Clone, Copy, Debug, Default)]
pub struct FalseAlarms {
    /// Alarms so far.
    pub count: u32,
    said_contact: bool,
}

impl FalseAlarms {
    /// Looks at a tick that has ended: what the controller said, and whether the tip touches.
    pub fn tick(&mut self, trial: &Trial, watch: &ContactWatch) {
        let says = trial.answer().flags.contains(StatusFlags::CONTACT);
        let slides = watch.captured_s.is_some() && watch.lift_offs == 0 && watch.touches();
        if slides && self.said_contact && !says && trial.fault().is_none() {
            self.count += 1;
        }
        self.said_contact = says;
    }
}

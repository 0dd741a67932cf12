//! False alarms: contact that the controller takes for flight.

use painleve_plant::Plant;
use painleve_plant::contact_probe::ContactProbe;
use painleve_shared::frame::StatusFlags;
use painleve_study_core::trial::Trial;

/// Counts how often the controller reports flight during a lasting contact.
#[derive(Clone, Copy, Debug, Default)]
pub struct FalseAlarms {
    /// Number of false alarms.
    pub count: u32,
    said_contact: bool,
}

impl FalseAlarms {
    /// Evaluates a completed tick: the contact that the controller reports against the true one.
    pub fn tick<P: Plant>(&mut self, trial: &Trial<P>, contact: &ContactProbe) {
        let says = trial.answer().flags.contains(StatusFlags::CONTACT);
        let slides = contact.captured_s.is_some() && contact.lift_offs == 0 && contact.touches();
        if slides && self.said_contact && !says && trial.fault().is_none() {
            self.count += 1;
        }
        self.said_contact = says;
    }
}

//! What happened in a run, in one sentence for the figure.

use painleve_plant::sample::Sample;
use painleve_plant::{ContactMode, Event};
use painleve_shared::status::Fault;

use crate::events::{EventKind, RunEvent};

/// Less than this is not worth a remark, m.
const NOTICEABLE_M: f64 = 1e-3;
/// A tip that has been on the belt for this long at the end of a run has come to stay, s.
const SETTLED_S: f64 = 0.5;

/// The outcome of a run as far as it has been seen.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Verdict {
    lift_offs: u64,
    first_lift_off_s: Option<f64>,
    last_landing_s: Option<f64>,
    time_s: f64,
    impacts: u64,
    fault: Option<Fault>,
    tip_m: f64,
    reference_m: Option<f64>,
    requested_m: Option<f64>,
}

impl Verdict {
    /// Updates the end of the run; `requested_m` is NaN if it is not known.
    pub(super) fn tick(&mut self, sample: &Sample, requested_m: f64) {
        let known = |value: f64| value.is_finite().then_some(value);
        self.time_s = sample.plant.time_s;
        self.tip_m = sample.plant.tip_t_m;
        self.reference_m = known(sample.reference_tip_t_m);
        self.requested_m = known(requested_m);
    }

    pub(super) fn event(&mut self, event: &RunEvent) {
        match event.kind {
            EventKind::Plant(Event::ModeChange {
                to: ContactMode::Flight,
                ..
            }) => {
                self.lift_offs += 1;
                self.first_lift_off_s.get_or_insert(event.time_s);
                self.last_landing_s = None;
            }
            EventKind::Plant(Event::ModeChange {
                from: ContactMode::Flight,
                ..
            }) => self.last_landing_s = Some(event.time_s),
            EventKind::Plant(Event::ImpactWithoutCollision { .. }) => {
                self.first_lift_off_s.get_or_insert(event.time_s);
            }
            EventKind::Plant(Event::Impact { .. }) => self.impacts += 1,
            EventKind::Fault(fault) => self.fault = Some(fault),
            _ => {}
        }
    }

    pub(super) fn words(&self) -> String {
        let mut words = match (self.lift_offs, self.first_lift_off_s) {
            (_, None) => "No lift-off".to_owned(),
            (0 | 1, Some(first_s)) => format!("Lifts off at {first_s:.3} s"),
            (count, Some(first_s)) => format!("Lifts off {count} times, first at {first_s:.3} s"),
        };
        match self.impacts {
            0 => {}
            1 => words.push_str(", 1 impact"),
            count => words.push_str(&format!(", {count} impacts")),
        }
        if let Some(landing_s) = self.last_landing_s
            && self.time_s - landing_s > SETTLED_S
        {
            words.push_str(&format!(", on the belt from {landing_s:.3} s"));
        }
        if let Some(reference_m) = self.reference_m {
            let error_mm = 1e3 * (self.tip_m - reference_m);
            words.push_str(&format!(
                "; ends {:.2} mm from its reference",
                error_mm.abs()
            ));
            if let Some(short_m) = self.requested_m.map(|requested| requested - reference_m)
                && short_m.abs() > NOTICEABLE_M
            {
                words.push_str(&format!(
                    ", which is held {:.1} mm short of the request",
                    1e3 * short_m.abs()
                ));
            }
        }
        if let Some(fault) = self.fault {
            words.push_str(&format!("; fault {}: {}", fault as u8, fault.description()));
        }
        words
    }
}

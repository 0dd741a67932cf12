//! Statistics of a run.

use crate::contact_probe::{CAPTURE_S, ContactProbe};
use crate::plant::{ContactMode, Event, Probe, Snapshot, State, Step};

/// Counts and extremes of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Statistics {
    /// Number of transitions from sliding or sticking to flight.
    pub lift_offs: u64,
    /// Time of the first lift-off, s.
    pub first_lift_off_s: Option<f64>,
    /// Capture of the tip, and the lift-offs after it.
    pub contact: ContactProbe,
    /// Collisions with the belt.
    pub impacts: u64,
    /// Impacts without collision.
    pub impacts_without_collision: u64,
    /// Smallest tip position along the belt, m.
    pub min_tip_t_m: f64,
    /// Largest tip position along the belt, m.
    pub max_tip_t_m: f64,
    /// Smallest normal force after the settling time, N; zero in flight.
    pub min_normal_force_n: f64,
    /// Present normal force, N; zero in flight.
    pub normal_force_n: f64,
    /// Largest joint torque, N·m.
    pub peak_torque_nm: f64,
    /// Time in contact, s.
    pub contact_s: f64,
    /// Observed time, s.
    pub total_s: f64,
    settling_s: f64,
}

impl Statistics {
    /// Starts empty statistics. The normal force is observed from `settling_s` on.
    pub fn new(settling_s: f64) -> Self {
        Self {
            lift_offs: 0,
            first_lift_off_s: None,
            contact: ContactProbe::new(f64::NEG_INFINITY, CAPTURE_S),
            impacts: 0,
            impacts_without_collision: 0,
            min_tip_t_m: f64::INFINITY,
            max_tip_t_m: f64::NEG_INFINITY,
            min_normal_force_n: f64::INFINITY,
            normal_force_n: 0.0,
            peak_torque_nm: 0.0,
            contact_s: 0.0,
            total_s: 0.0,
            settling_s,
        }
    }

    #[inline]
    fn observe(&mut self, at: &Snapshot) {
        self.min_tip_t_m = self.min_tip_t_m.min(at.tip_t_m);
        self.max_tip_t_m = self.max_tip_t_m.max(at.tip_t_m);
        self.normal_force_n = at.normal_force_n;
        self.peak_torque_nm = self.peak_torque_nm.max(at.torque_nm.amax());
        if at.time_s >= self.settling_s {
            self.min_normal_force_n = smaller(self.min_normal_force_n, at.normal_force_n);
        }
    }

    /// Returns the fraction of time in contact, 0 … 1.
    pub fn contact_fraction(&self) -> f64 {
        if self.total_s > 0.0 {
            self.contact_s / self.total_s
        } else {
            0.0
        }
    }
}

/// Returns the smaller force; NaN if either is. A rounding error at the instant of a lift-off
/// counts as zero, but a larger pull is reported.
#[inline]
fn smaller(least_n: f64, force_n: f64) -> f64 {
    const ROUNDING_N: f64 = 1e-6;
    let force_n = if (-ROUNDING_N..=0.0).contains(&force_n) {
        0.0
    } else {
        force_n
    };
    if least_n.is_nan() || force_n.is_nan() {
        return f64::NAN;
    }
    least_n.min(force_n)
}

impl Probe for Statistics {
    #[inline]
    fn step(&mut self, step: &dyn Step) {
        let duration = step.end_s() - step.start_s();
        self.total_s += duration;
        if step.mode().is_contact() {
            self.contact_s += duration;
        }
        self.contact.step(step);
        self.observe(&step.start());
        self.observe(&step.end());
    }

    fn event(&mut self, time_s: f64, event: Event, _: &State) {
        match event {
            Event::Impact { .. } => self.impacts += 1,
            Event::ImpactWithoutCollision { .. } => self.impacts_without_collision += 1,
            Event::ModeChange {
                to: ContactMode::Flight,
                ..
            } => {
                self.lift_offs += 1;
                self.first_lift_off_s.get_or_insert(time_s);
            }
            Event::ModeChange { .. } => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::smaller;

    #[test]
    fn a_pulling_or_nan_force_is_not_reported_as_zero() {
        assert_eq!(smaller(10.0, -1e-9).to_bits(), 0.0_f64.to_bits());
        assert_eq!(smaller(10.0, -0.1), -0.1);
        assert!(smaller(10.0, f64::NAN).is_nan());
        assert!(smaller(f64::NAN, 10.0).is_nan());
        assert_eq!(smaller(f64::INFINITY, 9.0), 9.0);
    }
}

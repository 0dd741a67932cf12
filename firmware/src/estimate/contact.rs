//! Decides whether the tip touches the belt. Every tick adds to the log-odds of contact against
//! flight.
//!
//! - **Force cell**: a reading f with noise σ is weighed between a contact of at least f_c and no
//!   contact: (f_c/σ²) (f − f_c/2). The decision does not chatter on a noisy reading near zero, and
//!   a clear reading changes it within two or three ticks. A tip in the air lands at f_c, so that a cell
//!   whose zero is wrong by half of f_c does not show a contact there.
//! - **Encoders**: the height of the tip above the belt is measured to half a count of each
//!   encoder, h = ½ (|z_t| Δθ₁ + l₂ |sin θ₂| Δθ₂₁). A gap larger than h shows flight. In addition,
//!   when the contact force vanishes, the joints accelerate against the prediction of the tracking
//!   loops, which includes the desired force. The innovations therefore weigh the desired force
//!   against none, as the force cell's reading does.

use painleve_shared::{Real, settings};

/// Log-odds beyond which contact or flight is certain, and the most that one reading adds to them. With 9 more runs were lost, with
/// 4.2 hardly any (lab book, *Factors on constants*).
const CERTAIN: f32 = 6.0;
/// Log-odds at which the decision changes.
const DECISION: f32 = CERTAIN / 2.0;
/// Largest contribution of a gap to contact.
const GAP_FOR: f32 = CERTAIN / 3.0;
/// Slope of the log-odds over the gap in units of its uncertainty.
const GAP_SLOPE: f32 = 3.0 * CERTAIN;
/// Variance of an innovation due to rounding, counts².
const INNOVATION_VARIANCE: f32 = 1.0 / 12.0;

settings! {
    /// The readings that decide about contact.
    #[derive(Copy, Eq)]
    pub enum Evidence = ForceCell {
        /// The force cell.
        "force-cell" => ForceCell,
        /// The encoders. Friction estimate and force loop still use the force cell.
        "encoders" => Encoders,
    }
}

settings! {
    /// Settings of the contact estimator.
    #[derive(Copy)]
    pub struct ContactSettings {
        /// Readings that decide about contact.
        evidence: Evidence = Evidence::ForceCell;
        /// Smallest normal force of a contact, f_c; at most the force cell's range.
        contact_n: f32 = 0.35, 1e-3..=1e6, "N";
        /// Standard deviation of one reading of the force cell, σ; at most the force cell's range.
        force_noise_n: f32 = 0.08, 1e-4..=1e6, "N";
    }
}

/// Weighs readings as evidence for contact or flight.
#[derive(Clone, Copy, Debug)]
pub struct ContactDetector {
    pub(super) settings: ContactSettings,
    /// f_c/σ², 1/N.
    slope_per_n: f32,
    /// The log-odds of contact, and the contact decision.
    log_odds: f32,
    contact: bool,
}

impl ContactDetector {
    /// Makes a detector with these settings, with the tip in the air, without certainty.
    pub fn new(settings: &ContactSettings) -> Self {
        Self {
            settings: *settings,
            slope_per_n: settings.contact_n / (settings.force_noise_n * settings.force_noise_n),
            log_odds: -DECISION,
            contact: false,
        }
    }

    /// Updates the decision with one tick's normal force from the force cell, N. Returns whether
    /// the tip touches.
    #[inline]
    pub fn update_from_force(&mut self, normal_force_n: f32) -> bool {
        let share = if self.contact { 0.5 } else { 1.0 };
        let above = normal_force_n - share * self.settings.contact_n;
        self.weigh((self.slope_per_n * above).within(CERTAIN))
    }

    /// Updates the decision with one tick's encoder readings: the measured height of the tip above the belt as a part of its
    /// largest error; ½ (|i − r|² − |i|²), counts², with the tracking loops' innovations i and those, r, that they would
    /// settle at without the expected contact force; and whether the readings differ from the previous ones. Returns
    /// whether the tip touches.
    pub fn update_from_encoders(&mut self, gap_ratio: f32, held_counts2: f32, moved: bool) -> bool {
        let gap = (GAP_SLOPE * (1.0 - gap_ratio)).limited(-CERTAIN, GAP_FOR);
        let release = (held_counts2 / INNOVATION_VARIANCE).limited(-CERTAIN, 0.0);
        // Unchanged readings add no evidence against contact.
        let least = if moved { f32::MIN } else { 0.0 };
        self.weigh((gap + release).at_least(least))
    }

    /// Adds to the log-odds and updates the decision.
    fn weigh(&mut self, change: f32) -> bool {
        self.log_odds = (self.log_odds + change).within(CERTAIN);
        let threshold = if self.contact { -DECISION } else { DECISION };
        self.contact = self.log_odds > threshold;
        self.contact
    }

    /// Returns whether flight is certain; initially it is not.
    pub fn is_in_flight(&self) -> bool {
        // The tip does not touch then.
        self.log_odds < -DECISION
    }

    /// Returns whether the contact decision is certain.
    pub fn is_certain(&self) -> bool {
        self.log_odds.abs() >= CERTAIN
    }

    /// Returns the certainty of the decision: 0 where it changes, 1 where it is certain.
    pub fn confidence(&self) -> f32 {
        let sign = if self.contact { 1.0 } else { -1.0 };
        ((sign * self.log_odds + DECISION) / (CERTAIN + DECISION)).at_least(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn detector() -> ContactDetector {
        ContactDetector::new(&ContactSettings::default())
    }

    /// Updates with a gap, m, that changes.
    fn update(detector: &mut ContactDetector, gap_m: f32) -> bool {
        detector.update_from_encoders(gap_m / 65e-6, 0.0, true)
    }

    /// Returns the number of ticks until the decision is `contact`.
    fn ticks_until(contact: bool, mut update: impl FnMut() -> bool) -> u32 {
        (1..100).find(|_| update() == contact).unwrap()
    }

    #[test]
    fn the_force_cell_decides_within_a_few_ticks_and_does_not_chatter() {
        let mut detector = detector();
        assert!(!detector.is_in_flight(), "initially flight is not certain");
        assert_eq!(ticks_until(true, || detector.update_from_force(0.5)), 2);
        for force in [0.3, 0.15, 0.4, 0.2, 0.35, 0.25] {
            assert!(detector.update_from_force(force), "{force}");
        }
        for _ in 0..3 {
            detector.update_from_force(10.0);
        }
        assert_eq!(detector.confidence(), 1.0);
        assert!(ticks_until(false, || detector.update_from_force(0.0)) <= 3);
        assert!(!detector.update_from_force(0.1));
    }

    #[test]
    fn a_force_cell_with_a_wrong_zero_shows_no_contact_in_the_air() {
        let mut detector = detector();
        for tick in 0..1000 {
            let noise_n = [0.1, -0.1, 0.05, -0.05][tick % 4];
            assert!(!detector.update_from_force(0.2 + noise_n));
        }
        // A tip that lands presses more.
        assert_eq!(ticks_until(true, || detector.update_from_force(1.0)), 2);
    }

    #[test]
    fn a_gap_that_the_encoders_resolve_is_no_contact() {
        let mut detector = detector();
        for tick in 0..1000 {
            // Quantisation alone.
            update(&mut detector, if tick % 7 < 3 { 49e-6 } else { -49e-6 });
        }
        assert!(detector.contact);
        assert!(ticks_until(false, || update(&mut detector, 100e-6)) <= 3);
        assert!(ticks_until(true, || update(&mut detector, 0.0)) <= 8);
    }

    #[test]
    fn an_unchanged_reading_adds_no_evidence_against_contact() {
        let mut detector = detector();
        for _ in 0..20 {
            update(&mut detector, 0.0);
        }
        for _ in 0..100 {
            assert!(detector.update_from_encoders(80.0 / 65.0, 0.0, false));
        }
        assert!(ticks_until(false, || update(&mut detector, 80e-6)) <= 3);
    }

    #[test]
    fn a_missing_contact_force_is_flight_unless_it_is_too_small_to_detect() {
        // The full loss of force, and the fraction of it that shows.
        let ticks_until_flight = |full_release: f32, part: f32| {
            let mut detector = detector();
            let mut update =
                |part| detector.update_from_encoders(0.0, full_release * (0.5 - part), true);
            for _ in 0..20 {
                update(0.0);
            }
            (1..100).find(|_| !update(part))
        };
        assert_eq!(ticks_until_flight(9.0, 1.0), Some(3));
        assert_eq!(ticks_until_flight(9.0, 0.4), None);
        assert_eq!(ticks_until_flight(9.0, -3.0), None);
        assert_eq!(ticks_until_flight(0.1, 1.0), None);
    }
}

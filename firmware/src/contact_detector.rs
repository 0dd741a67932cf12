//! Does the tip touch the belt? Decided from the force cell, with hysteresis in
//! force and in time, so that a noisy reading near zero does not chatter.

use painleve_shared::range::{self, OutOfRange};
use serde::{Deserialize, Serialize};

/// Thresholds of the contact detector.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ContactDetectorSettings {
    /// Contact is made when f_n has been above this, N …
    pub touch_n: f32,
    /// … for so many ticks in a row.
    pub touch_ticks: u32,
    /// Contact is lost when f_n has been below this, N …
    pub release_n: f32,
    /// … for so many ticks in a row.
    pub release_ticks: u32,
}

impl Default for ContactDetectorSettings {
    fn default() -> Self {
        Self {
            touch_n: 0.2,
            touch_ticks: 3,
            release_n: 0.1,
            release_ticks: 3,
        }
    }
}

impl ContactDetectorSettings {
    /// Checks the thresholds against the force cell's range (N).
    ///
    /// # Errors
    /// [`OutOfRange`] naming the first key that is out of range.
    pub fn validate(&self, force_range_n: f32) -> Result<(), OutOfRange> {
        range::check(
            "controller.contact.touch_n",
            self.touch_n,
            0.0,
            f64::from(force_range_n),
        )?;
        range::check(
            "controller.contact.release_n",
            self.release_n,
            0.0,
            f64::from(self.touch_n),
        )?;
        let ticks = |key, value: u32| range::check(key, f64::from(value), 1.0, 1e6);
        ticks("controller.contact.touch_ticks", self.touch_ticks)?;
        ticks("controller.contact.release_ticks", self.release_ticks)
    }
}

/// Contact flag with hysteresis.
#[derive(Clone, Copy, Debug)]
pub struct ContactDetector {
    settings: ContactDetectorSettings,
    contact: bool,
    /// Ticks in a row that speak against the present flag.
    contrary_ticks: u32,
}

impl ContactDetector {
    /// A detector that takes the tip to be in the air.
    pub fn new(settings: ContactDetectorSettings) -> Self {
        Self {
            settings,
            contact: false,
            contrary_ticks: 0,
        }
    }

    /// Takes in one reading of the normal force (N); returns whether the tip touches.
    pub fn update(&mut self, normal_force_n: f32) -> bool {
        let (contrary, limit) = if self.contact {
            (
                normal_force_n < self.settings.release_n,
                self.settings.release_ticks,
            )
        } else {
            (
                normal_force_n > self.settings.touch_n,
                self.settings.touch_ticks,
            )
        };
        self.contrary_ticks = if contrary { self.contrary_ticks + 1 } else { 0 };
        if self.contrary_ticks >= limit {
            self.contact = !self.contact;
            self.contrary_ticks = 0;
        }
        self.contact
    }

    /// Whether the tip is taken to touch.
    pub fn contact(&self) -> bool {
        self.contact
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contact_needs_several_readings_in_a_row() {
        let mut detector = ContactDetector::new(ContactDetectorSettings::default());
        for force in [1.0, 1.0, 0.0, 1.0, 1.0] {
            assert!(!detector.update(force));
        }
        assert!(detector.update(1.0));
        for force in [0.0, 0.0, 0.15, 0.0, 0.0] {
            assert!(detector.update(force));
        }
        assert!(!detector.update(0.0));
    }
}

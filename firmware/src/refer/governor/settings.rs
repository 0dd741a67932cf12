//! What can be set about the edge governor.

use painleve_shared::range::{self, OutOfRange};
use serde::{Deserialize, Serialize};

/// Settings of the edge governor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GovernorSettings {
    /// Whether the reference is governed.
    pub enabled: bool,
    /// Least p as a part of Q22.
    pub minimum_p_ratio: f32,
    /// What is added to that for slow sampling, times the square of the time between ticks, 1/s²:
    /// so far does a disturbance move the tip before anything is done about it.
    pub p_ratio_per_s2: f32,
    /// Deviations of the friction estimate that are added to it.
    pub friction_deviations: f32,
    /// Distance that is kept from where p has its least value, m.
    pub distance_m: f32,
    /// What is added to that for each count of the encoders at the tip: so far is the tip moved
    /// to and fro by their rounding.
    pub distance_counts: f32,
    /// Deceleration with which the reference stops before an edge, m/s².
    pub braking_m_s2: f32,
    /// Fastest approach to a reference that is away from the tip, m/s.
    pub catch_up_m_s: f32,
}

impl Default for GovernorSettings {
    fn default() -> Self {
        Self {
            enabled: true,
            minimum_p_ratio: 0.01,
            p_ratio_per_s2: 1e4,
            friction_deviations: 1.5,
            distance_m: 0.5e-3,
            distance_counts: 3.0,
            braking_m_s2: 1.0,
            catch_up_m_s: 0.3,
        }
    }
}

impl GovernorSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`OutOfRange`] naming the first key that is out of range.
    pub fn validate(&self) -> Result<(), OutOfRange> {
        let key = |key, value, minimum, maximum| range::check(key, value, minimum, maximum);
        key(
            "controller.governor.minimum_p_ratio",
            self.minimum_p_ratio,
            0.0,
            0.9,
        )?;
        key(
            "controller.governor.p_ratio_per_s2",
            self.p_ratio_per_s2,
            0.0,
            1e6,
        )?;
        key(
            "controller.governor.distance_counts",
            self.distance_counts,
            0.0,
            1e3,
        )?;
        key(
            "controller.governor.friction_deviations",
            self.friction_deviations,
            0.0,
            10.0,
        )?;
        key("controller.governor.distance_m", self.distance_m, 0.0, 0.1)?;
        key(
            "controller.governor.braking_m_s2",
            self.braking_m_s2,
            1e-3,
            1e3,
        )?;
        key(
            "controller.governor.catch_up_m_s",
            self.catch_up_m_s,
            1e-3,
            10.0,
        )
    }
}

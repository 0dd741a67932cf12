//! What can be set about the hybrid law.

use painleve_shared::range::{self, OutOfRange};
use serde::{Deserialize, Serialize};

/// Where the friction f_t that the law compensates comes from.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum FrictionFeedForward {
    /// The last reading of the force cell, as in the paper.
    Measured,
    /// The reading through a first-order low-pass.
    Filtered {
        /// Time constant τ, s.
        time_constant_s: f32,
    },
    /// The estimated friction −μ̂ s α_f, corrected by the reading through a low-pass:
    /// d̂ += k (f_t + μ̂ s α_f − d̂) with k = min(T/τ, ½ p̂/Q22), so that the pole of the
    /// loop through the contact, 1 − k Q22/p, stays near ½ however close the edge is.
    Observed {
        /// Time constant τ far from the edge, s.
        time_constant_s: f32,
    },
    /// Coulomb friction −μ sign(ż_r) α_f with a known belt.
    Model {
        /// Friction coefficient μ.
        friction: f32,
        /// Belt speed, m/s.
        belt_speed_m_s: f32,
    },
}

/// Settings of the hybrid law.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HybridSettings {
    /// Wanted normal force f_n*, N.
    pub normal_force_n: f32,
    /// K'_P, 1/s².
    pub position_gain_per_s2: f32,
    /// K'_D, 1/s.
    pub velocity_gain_per_s: f32,
    /// Gain of ∫ (z_t* − z_t) dt, 1/s³; not in the paper.
    pub position_integral_gain_per_s3: f32,
    /// Largest acceleration by that integral, m/s².
    pub position_integral_limit_m_s2: f32,
    /// Time constant with which f_n* is approached after landing, s; 0 for at once, as in the paper.
    pub force_time_constant_s: f32,
    /// Whether the tip is pressed less where the torque limits do not allow f_n*; not in the paper.
    pub presses_less: bool,
    /// K'_I, 1/s.
    pub force_integral_gain_per_s: f32,
    /// Largest correction by the force integral, N.
    pub force_integral_limit_n: f32,
    /// Friction feed-forward.
    pub friction: FrictionFeedForward,
}

impl Default for HybridSettings {
    /// Gains that survive a sample of delay at 1 kHz and 14-bit encoders.
    fn default() -> Self {
        Self {
            normal_force_n: 10.0,
            position_gain_per_s2: 3000.0,
            velocity_gain_per_s: 100.0,
            position_integral_gain_per_s3: 20_000.0,
            position_integral_limit_m_s2: 200.0,
            force_time_constant_s: 0.02,
            presses_less: true,
            force_integral_gain_per_s: 5.0,
            force_integral_limit_n: 5.0,
            friction: FrictionFeedForward::Observed {
                time_constant_s: 0.015,
            },
        }
    }
}

impl HybridSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`OutOfRange`] naming the first key that is out of range.
    pub fn validate(&self) -> Result<(), OutOfRange> {
        let key = |key, value, maximum| range::check(key, value, 0.0, maximum);
        key(
            "controller.law.hybrid.normal_force_n",
            self.normal_force_n,
            1e3,
        )?;
        key(
            "controller.law.hybrid.position_gain_per_s2",
            self.position_gain_per_s2,
            1e6,
        )?;
        key(
            "controller.law.hybrid.velocity_gain_per_s",
            self.velocity_gain_per_s,
            1e4,
        )?;
        key(
            "controller.law.hybrid.position_integral_gain_per_s3",
            self.position_integral_gain_per_s3,
            1e9,
        )?;
        key(
            "controller.law.hybrid.position_integral_limit_m_s2",
            self.position_integral_limit_m_s2,
            1e6,
        )?;
        key(
            "controller.law.hybrid.force_time_constant_s",
            self.force_time_constant_s,
            10.0,
        )?;
        key(
            "controller.law.hybrid.force_integral_gain_per_s",
            self.force_integral_gain_per_s,
            1e4,
        )?;
        key(
            "controller.law.hybrid.force_integral_limit_n",
            self.force_integral_limit_n,
            1e3,
        )?;
        match self.friction {
            FrictionFeedForward::Measured => Ok(()),
            FrictionFeedForward::Filtered { time_constant_s } => key(
                "controller.law.hybrid.friction.filtered.time_constant_s",
                time_constant_s,
                10.0,
            ),
            FrictionFeedForward::Observed { time_constant_s } => key(
                "controller.law.hybrid.friction.observed.time_constant_s",
                time_constant_s,
                10.0,
            ),
            FrictionFeedForward::Model {
                friction,
                belt_speed_m_s,
            } => {
                key(
                    "controller.law.hybrid.friction.model.friction",
                    friction,
                    10.0,
                )?;
                range::check(
                    "controller.law.hybrid.friction.model.belt_speed_m_s",
                    belt_speed_m_s,
                    -100.0,
                    100.0,
                )
            }
        }
    }
}

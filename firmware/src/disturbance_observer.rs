//! What the model does not know, as a torque.
//!
//! The equations of motion, M θ̈ + w + c − Jᵀ f − u = d, leave what a wrong mass, spring or
//! length and unmodelled friction in the joints ask for. Every term on the left is measured,
//! so that d needs no model of the contact. Near the edge this is what counts: an error d of the
//! free normal acceleration b = … changes f_n by d/p.
//!
//! The residual is low-passed. Forces and torques of one instant belong together; where they
//! are a few ticks apart, the filter closes a loop through the contact, whose gain is
//! Q22/p. It is therefore slowed down with p, as the law's friction filter is.

use nalgebra::Vector2;
use painleve_shared::Real;
use painleve_shared::range::{self, OutOfRange};
use serde::{Deserialize, Serialize};

/// Settings of the disturbance observer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DisturbanceSettings {
    /// Whether the disturbance is estimated.
    pub enabled: bool,
    /// Bandwidth far from the edge, rad/s.
    pub bandwidth_rad_s: f32,
    /// Largest disturbance of either joint, N·m.
    pub limit_nm: f32,
}

impl Default for DisturbanceSettings {
    fn default() -> Self {
        Self {
            enabled: true,
            bandwidth_rad_s: 20.0,
            limit_nm: 1.0,
        }
    }
}

impl DisturbanceSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`OutOfRange`] naming the first key that is out of range.
    pub fn validate(&self) -> Result<(), OutOfRange> {
        range::check(
            "controller.disturbance.bandwidth_rad_s",
            self.bandwidth_rad_s,
            0.0,
            1e3,
        )?;
        range::check("controller.disturbance.limit_nm", self.limit_nm, 0.0, 1e3)
    }
}

/// Largest part of the residual that is taken over in a tick at the edge's own pace.
const SHARE: f32 = 0.25;

/// The observer with its state.
#[derive(Clone, Copy, Debug)]
pub struct DisturbanceObserver {
    settings: DisturbanceSettings,
    torque_nm: Vector2<f32>,
    tick_s: f32,
}

impl DisturbanceObserver {
    /// An observer that has seen no disturbance.
    pub fn new(settings: &DisturbanceSettings, tick_s: f32) -> Self {
        Self {
            settings: *settings,
            torque_nm: Vector2::zeros(),
            tick_s,
        }
    }

    /// The generalised torque d, N·m.
    pub fn torque_nm(&self) -> &Vector2<f32> {
        &self.torque_nm
    }

    /// Takes in what the equations of motion with the present d leave (N·m), where p is
    /// `p_ratio` of Q22.
    pub fn update(&mut self, residual_nm: &Vector2<f32>, p_ratio: f32) {
        if !self.settings.enabled {
            return;
        }
        let weight = (self.settings.bandwidth_rad_s * self.tick_s)
            .at_most(SHARE * p_ratio)
            .at_least(0.0);
        let limit = self.settings.limit_nm;
        self.torque_nm =
            (self.torque_nm + residual_nm * weight).map(|torque| torque.limited(-limit, limit));
    }
}

//! The measured height of the tip above the belt: evidence of contact from the encoders, and of the links' length.

use super::Estimators;
use super::contact::EncoderReading;
use crate::last_command::LastCommand;

/// Uncertainty of the gap beyond the encoders' resolution, m; averaging does not remove all of it, because successive roundings
/// are not independent.
const GAP_UNCERTAINTY_M: f32 = 20e-6;

impl Estimators {
    /// Returns the measured height of the tip above the belt, m.
    #[inline]
    pub(super) fn gap_m(&self) -> f32 {
        let residual = self.joints.residual_rad();
        let model = &self.model;
        let jacobian = &model.jacobian;
        model.gap_m + jacobian.m21 * residual.first() + jacobian.m22 * residual.second()
    }

    /// Returns the contact evidence from the encoders. The belt is assumed at the lowest tip position so far: initially the
    /// start position, then every lower one.
    pub(super) fn encoder_reading(&mut self, last: &LastCommand) -> EncoderReading {
        let model = &self.model;
        let count_rad = self.joints.rad_per_count;
        // Half a count of each encoder; the second encoder affects θ2 alone.
        let rounding_m =
            0.5 * (model.tip_m.x.abs() * count_rad + model.jacobian.m22.abs() * count_rad);
        // Steady innovation after the contact force has vanished.
        let release = -self.joints.lag_counts(&last.contact_acceleration_rad_s2);
        let mut gap_m = self.gap_m();
        let gap_error_m = GAP_UNCERTAINTY_M + self.calibrator.gap_error_m(rounding_m);
        if self.calibrator.is_open() || gap_m < -gap_error_m {
            self.calibrator.restart(&mut self.arm, gap_m);
            gap_m = 0.0;
        }
        EncoderReading {
            gap_m,
            gap_error_m,
            moved: self.joints.moved,
            release: release.dot(&self.joints.innovation_counts()),
            full_release: release.norm_squared(),
        }
    }
}

//! The measured height of the tip above the belt: evidence of contact from the encoders, and of the links' length.

use super::Estimators;
use crate::last_command::LastCommand;

/// Uncertainty of the gap beyond the encoders' resolution, m; averaging does not remove all of it, because successive roundings
/// are not independent.
const GAP_UNCERTAINTY_M: f32 = 20e-6;

impl Estimators {
    /// Returns the measured height of the tip above the belt, m.
    #[inline]
    pub(super) fn gap_m(&self) -> f32 {
        // Measured minus estimated angles after the correction.
        let residual = self.joints.innovation_rad.to_links() * (1.0 - self.joints.angle_gain);
        let jacobian = &self.model.jacobian;
        self.model.gap_m + jacobian.m21 * residual.first() + jacobian.m22 * residual.second()
    }

    /// Decides about contact from the encoders: returns whether the tip touches. The belt is assumed at the lowest tip
    /// position so far: initially the start position, then every lower one.
    pub(super) fn touches_by_encoders(&mut self, last: &LastCommand) -> bool {
        let (model, joints) = (&self.model, &self.joints);
        let count_rad = joints.rad_per_count;
        // Half a count of each encoder; the second encoder affects θ2 alone.
        let rounding_m =
            0.5 * (model.tip_m.x.abs() * count_rad + model.jacobian.m22.abs() * count_rad);
        // Steady innovation after the contact force has vanished.
        let release = last.contact_acceleration_rad_s2.vector() * -joints.lag_counts_s2;
        let innovation = joints.innovation_rad.vector() * (1.0 / count_rad);
        let held_counts2 = 0.5 * release.norm_squared() - release.dot(&innovation);
        let moved = joints.moved;
        let mut gap_m = self.gap_m();
        let gap_error_m = GAP_UNCERTAINTY_M + self.calibrator.gap_error_m(rounding_m);
        if self.calibrator.is_open() || gap_m < -gap_error_m {
            self.calibrator.restart(&mut self.arm, gap_m);
            gap_m = 0.0;
        }
        self.detector
            .update_from_encoders(gap_m / gap_error_m, held_counts2, moved)
    }
}

//! Two-axis force cell under the tip: samples the contact force at the tick.
//!
//! The collisions of a rigid body last no time, so that no sample ever hits one: the cell
//! sees the forces between them, as a cell with a good anti-spike filter would.

use nalgebra::Vector2;
use painleve_shared::counts::{ForceCounts, LinearScale};
use painleve_shared::range::{self, OutOfRange};
use serde::{Deserialize, Serialize};

use super::noise::{Channel, Noise};

/// Settings of both axes of the force cell.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ForceCellSettings {
    /// Resolution: 2^bits counts over the whole range.
    pub bits: u8,
    /// Full scale to either side, N; beyond it the reading saturates.
    pub range_n: f64,
    /// Standard deviation of the noise, N.
    pub noise_n: f64,
}

impl Default for ForceCellSettings {
    fn default() -> Self {
        Self {
            bits: 12,
            range_n: 20.0,
            noise_n: 0.02,
        }
    }
}

impl ForceCellSettings {
    /// Checks every setting.
    ///
    /// # Errors
    /// [`OutOfRange`] naming the first key that is out of range.
    pub fn validate(&self) -> Result<(), OutOfRange> {
        range::check("converters.force.bits", f64::from(self.bits), 4.0, 22.0)?;
        range::check("converters.force.range_n", self.range_n, 1e-3, 1e6)?;
        range::check("converters.force.noise_n", self.noise_n, 0.0, self.range_n)
    }

    fn scale(&self) -> LinearScale<f64> {
        LinearScale {
            bits: self.bits,
            range: self.range_n,
        }
    }
}

/// The force cell with its noise.
#[derive(Clone, Debug)]
pub struct ForceCell {
    scale: LinearScale<f64>,
    tangential_noise: Noise,
    normal_noise: Noise,
}

impl ForceCell {
    /// A force cell.
    pub fn new(settings: &ForceCellSettings, seed: u64) -> Self {
        Self {
            scale: settings.scale(),
            tangential_noise: Noise::new(seed, Channel::TangentialForce, settings.noise_n),
            normal_noise: Noise::new(seed, Channel::NormalForce, settings.noise_n),
        }
    }

    /// Readings (f_t, f_n) of a contact force (f_t, f_n), N.
    pub fn read(&mut self, force_n: &Vector2<f64>) -> (ForceCounts, ForceCounts) {
        let (tangential, _) = self.scale.counts(force_n.x + self.tangential_noise.draw());
        let (normal, _) = self.scale.counts(force_n.y + self.normal_noise.draw());
        (ForceCounts(tangential), ForceCounts(normal))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readings_round_to_the_nearest_count_and_saturate() {
        let settings = ForceCellSettings {
            noise_n: 0.0,
            ..Default::default()
        };
        let mut cell = ForceCell::new(&settings, 1);
        let (tangential, normal) = cell.read(&Vector2::new(-100.0, 10.0));
        assert_eq!(tangential, ForceCounts(-2048));
        assert_eq!(normal, ForceCounts(1024));
    }
}

//! Two-axis force cell under the tip: samples the contact force at the tick.
//!
//! A collision of rigid bodies takes no time, so no sample falls into one: the cell measures the
//! forces between collisions, like a cell with a good anti-spike filter.

use nalgebra::Vector2;
use painleve_shared::counts::{ForceCounts, LinearScale};
use painleve_shared::{OutOfRange, check_setting, settings};

use super::noise::{Channel, Noise};

settings! {
    /// Settings of both axes of the force cell.
    #[derive(Copy)]
    pub struct ForceCellSettings {
        /// Resolution: 2^bits counts over the whole range.
        bits: u8 = 12, 4..=22, "bits";
        /// Full scale to either side; beyond it the reading saturates.
        range_n: f64 = 20.0, 1e-3..=1e6, "N";
        /// Standard deviation of the noise; at most `range_n`.
        noise_n: f64 = 0.02, 0.0..=1e6, "N";
    }
    check Self::relations;
}

impl ForceCellSettings {
    fn relations(&self) -> Result<(), OutOfRange> {
        check_setting!(self.noise_n, 0.0, self.range_n)
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
    /// Creates a force cell.
    pub fn new(settings: &ForceCellSettings, seed: u64) -> Self {
        Self {
            scale: settings.scale(),
            tangential_noise: Noise::new(seed, Channel::TangentialForce, settings.noise_n),
            normal_noise: Noise::new(seed, Channel::NormalForce, settings.noise_n),
        }
    }

    /// Returns the readings (f_t, f_n) of a contact force (f_t, f_n), N.
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

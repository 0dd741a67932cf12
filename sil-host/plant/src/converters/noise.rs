//! Seeded Gaussian noise, one independent stream per channel.

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

/// A channel's noise. Equal seeds and channels give equal noise on every host.
#[derive(Clone, Debug)]
pub struct Noise {
    deviation: f64,
    generator: Pcg64,
}

/// Channels with independent noise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    /// Encoder of θ1.
    Encoder1,
    /// Encoder of θ2 − θ1.
    Encoder2,
    /// Force cell, tangential.
    TangentialForce,
    /// Force cell, normal.
    NormalForce,
}

impl Noise {
    /// Creates noise with standard deviation `deviation`, in the channel's
    /// unit.
    pub fn new(seed: u64, channel: Channel, deviation: f64) -> Self {
        // Spreads the channel number over all bits, so that small seeds of
        // different channels never give the same stream.
        let stream = (channel as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        Self {
            deviation,
            generator: Pcg64::seed_from_u64(seed ^ stream),
        }
    }

    /// Returns the next value.
    #[inline]
    pub fn draw(&mut self) -> f64 {
        if self.deviation == 0.0 {
            return 0.0;
        }
        let normal: f64 = StandardNormal.sample(&mut self.generator);
        normal * self.deviation
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_are_repeatable_and_differ_between_channels() {
        let draw = |seed, channel| Noise::new(seed, channel, 1.0).draw();
        assert_eq!(draw(1, Channel::Encoder1), draw(1, Channel::Encoder1));
        assert_ne!(draw(1, Channel::Encoder1), draw(1, Channel::Encoder2));
        assert_ne!(draw(1, Channel::Encoder1), draw(2, Channel::Encoder1));
    }

    #[test]
    fn the_noise_has_the_set_deviation() {
        let mut noise = Noise::new(7, Channel::NormalForce, 0.5);
        let draws: Vec<f64> = (0..20_000).map(|_| noise.draw()).collect();
        let mean = draws.iter().sum::<f64>() / 2e4;
        let variance = draws.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 2e4;
        assert!(mean.abs() < 0.02 && (variance.sqrt() - 0.5).abs() < 0.02);
    }
}

//! Which values a trial has.

use std::str::FromStr;

use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};

use super::Trial;

/// Trials that are computed at once: each knows only those of earlier batches.
pub const BATCH: usize = 8;
/// After the first batch, one of so many trials is anywhere in the ranges.
const ANYWHERE: usize = 3;
/// Number of the best trials that others are near to.
const PARENTS: usize = 3;
/// Distance of the first of these, and the smallest, in widths of the ranges.
const FAR: f64 = 0.15;
const NEAR: f64 = 0.02;
/// How fast the distance shrinks: it is proportional to the number of trials to the power of this.
const SHRINKING: f64 = -0.75;
/// The search has streams of its own, apart from those of the cases.
const STREAM: u64 = 1 << 32;

/// A key with the range of its values.
#[derive(Clone, Debug, PartialEq)]
pub struct Range {
    /// The key, as in `controller.law.hybrid.velocity_gain_per_s`.
    pub key: String,
    /// Smallest value.
    pub from: f64,
    /// Largest value.
    pub to: f64,
}

/// Why a text is not a range.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "'{0}' is not KEY=FROM:TO with 0 < FROM < TO, as in controller.law.hybrid.normal_force_n=5:20"
)]
pub struct RangeError(String);

impl FromStr for Range {
    type Err = RangeError;

    fn from_str(text: &str) -> Result<Self, RangeError> {
        let wrong = || RangeError(text.into());
        let (key, ends) = text.split_once('=').ok_or_else(wrong)?;
        let (from, to) = ends.split_once(':').ok_or_else(wrong)?;
        let number = |text: &str| text.trim().parse::<f64>().map_err(|_| wrong());
        let (from, to) = (number(from)?, number(to)?);
        if !(from > 0.0 && from < to && to.is_finite()) || key.trim().is_empty() {
            return Err(wrong());
        }
        Ok(Self {
            key: key.trim().into(),
            from,
            to,
        })
    }
}

impl Range {
    /// Returns the value at a share of the range, from 0 to 1, on a logarithmic scale.
    pub fn at(&self, share: f64) -> f64 {
        match share {
            ..=0.0 => self.from,
            1.0.. => self.to,
            _ => self.from * libm::pow(self.to / self.from, share),
        }
    }

    /// Returns the share of the range at which a value is.
    fn share(&self, value: f64) -> f64 {
        libm::log(value / self.from) / libm::log(self.to / self.from)
    }
}

/// Returns the values of trial `index`. Of the earlier `trials` it uses those of complete batches only.
pub(super) fn values(ranges: &[Range], trials: &[Trial], index: usize, seed: u64) -> Vec<f64> {
    let mut generator = ChaCha8Rng::seed_from_u64(seed);
    generator.set_stream(STREAM + index as u64);
    let known = &trials[..(index - index % BATCH).min(trials.len())];
    if index.is_multiple_of(ANYWHERE) || known.is_empty() {
        return ranges
            .iter()
            .map(|range| range.at(generator.random_range(0.0..1.0)))
            .collect();
    }
    let mut best: Vec<&Trial> = known.iter().collect();
    best.sort_by(|one, other| one.cost.total_cmp(&other.cost));
    let parent = best[index / ANYWHERE % PARENTS.min(best.len())];
    let distance = (FAR * libm::pow(index as f64 / BATCH as f64, SHRINKING)).max(NEAR);
    let around = |(range, value): (&Range, &f64)| {
        // The sum of three uniform numbers is nearly normal, with a deviation of 1.
        let step: f64 = (0..3).map(|_| generator.random_range(-1.0..1.0)).sum();
        range.at(range.share(*value) + distance * step)
    };
    ranges.iter().zip(&parent.values).map(around).collect()
}

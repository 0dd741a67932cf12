//! Estimates the friction coefficient and the direction of slip from the force cell.
//!
//! While the tip slides, −s f_t/f_n equals μ exactly, whatever the controller does: the ratio is
//! not part of any loop. A scalar Kalman filter averages it. The variance is that of a ratio of
//! noisy forces, σ² (1 + μ²)/f_n², and what is known of μ is forgotten in the averaging time of the response.
//!
//! Readings without information about μ are skipped: in the air, at a small normal force, and in
//! stick, where friction takes any value up to μ f_n in either direction. Stick is detected by a
//! ratio well below the estimate while the belt drags the tip along; otherwise μ has changed and the
//! filter restarts.
//! The estimated direction of slip reverses only on a friction force near the opposite side of the
//! cone, because in stick the sign of the force carries no information.
//!
//! A tick only corrects the estimate, with readings in newtons, whose noise does not depend on f_n; the variances, which
//! the next gain needs, are updated after the tick is answered.

use nalgebra::Vector2;
use painleve_shared::{Real, Slip, settings};

use super::contact::ContactSettings;
use super::response::AVERAGING_S;

/// Square of the number of standard deviations, four, beyond which something is not noise: the sign of a friction force, an
/// average of innovations, a change of the innovation. A sudden change of μ is not noise: counted as such, it would hide the next
/// one. No campaign shows the need for the last one; a test does.
const NO_NOISE_SQUARE: f32 = 16.0;
/// The same, eight, of a single reading: of another μ or, below the estimate, of a tip that may stick. A rule for each did no
/// better (lab book, *Parts of the friction estimate left out*).
const DIFFERENT_SQUARE: f32 = 4.0 * NO_NOISE_SQUARE;

/// Fraction of the estimated friction that indicates a slip in the opposite direction. From 0 to 0.96, it changes no run (lab
/// book, *Factors on constants*, *Captures of an arm that is not known*), but of a tip that sticks, less friction on the other side
/// shows no slip.
const REVERSAL_FRACTION: f32 = 0.8;

/// Number of such ticks in a row that reverse the slip. Friction of a tip that bounces alternates: with one tick, four
/// more of 300 arms were thrown too fast to be identified (lab book, *One contrary tick instead of three*).
const REVERSAL_TICKS: u8 = 3;

/// Least variance of the noise of a ratio that is considered, as a part of the one that the force cell's noise gives. Ten times of
/// it lost more runs, next to none of it no more (the same sections), but readings that happen to be equal would then make the next
/// one a sudden change of μ.
const LEAST_NOISE: f32 = 0.01;

/// Averaging time of the innovations, s. With 0.05 s more runs were lost (lab book, *Constants merged*).
const MEAN_S: f32 = 0.02;
/// Ticks for which the torque misses a sudden change of μ: on average half a tick until a reading shows it,
/// and one until the torque that it causes acts. Without them, eleven more of 200 runs over patches of μ were
/// lost (lab book, *Captures of an arm that is not known*).
const MISSED_TICKS: f32 = 1.5;

settings! {
    /// Settings of the friction estimator.
    #[derive(Copy)]
    pub struct FrictionSettings {
        /// Initial estimate of μ.
        first_guess: f32 = 0.6, 0.0..=2.0;
        /// Standard deviation of the initial estimate, and of μ whenever the filter restarts; 0 if μ is known exactly,
        /// and not estimated.
        first_deviation: f32 = 0.15, 0.0..=2.0;
    }
}

/// The friction estimate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrictionEstimate {
    /// Estimated friction coefficient μ̂.
    pub coefficient: f32,
    /// Excess of μ that, fed forward in this tick, gives the tip the impulse that it has missed since a change
    /// of μ.
    pub catch_up: f32,
    /// Variance of μ̂.
    pub variance: f32,
    /// Direction of slip, from the sign of the friction force.
    pub slip: Slip,
    /// Whether a slip has been observed; until then, `slip` is a guess.
    pub slip_seen: bool,
    /// Whether the tip is estimated to stick to the belt.
    pub sticks: bool,
}

impl FrictionEstimate {
    /// Returns the estimate before the first reading.
    pub fn first(settings: &FrictionSettings) -> Self {
        Self {
            coefficient: settings.first_guess,
            variance: settings.first_deviation * settings.first_deviation,
            ..Self::default()
        }
    }

    /// Returns the standard deviation of μ̂.
    pub fn deviation(&self) -> f32 {
        self.variance.square_root()
    }
}

/// The filter with its settings. The estimate itself is part of what is known of the contact.
#[derive(Clone, Copy, Debug, Default)]
pub struct FrictionEstimator {
    /// Normal force below which friction is not observed, N.
    observable_n: f32,
    force_variance_n2: f32,
    /// Largest variance of μ, at the start and whenever the filter restarts, and the factor by which it grows in one tick.
    first_variance: f32,
    forgetting: f32,
    /// Weight of one innovation in their average.
    mean_weight: f32,
    /// Ticks in a row that indicate a slip in the opposite direction.
    contrary_ticks: u8,
    /// Whether the next reading may show another slip.
    slip_in_doubt: bool,
    /// The last correction, until the update.
    correction: Option<Correction>,
    /// Average of the last innovations.
    mean_innovation: f32,
    /// Last innovation.
    innovation: f32,
    /// Variance of the noise of the ratio.
    noise_variance: f32,
    /// Variance of a reading's force by the noise of the force cell, σ² (1 + μ²), N².
    reading_variance_n2: f32,
}

/// What a reading has changed.
#[derive(Clone, Copy, Debug)]
struct Correction {
    /// Measured less expected friction force, as a ratio to the normal force.
    innovation: f32,
    /// Gain of the filter.
    gain: f32,
}

impl FrictionEstimator {
    /// Makes an estimator that is called every `tick_s`, for the readings of a force cell with these settings.
    pub fn new(settings: &FrictionSettings, cell: &ContactSettings, tick_s: f32) -> Self {
        let square = |deviation: f32| deviation * deviation;
        let force_variance_n2 = square(cell.force_noise_n);
        let first_variance = square(settings.first_deviation);
        Self {
            observable_n: cell.contact_n,
            force_variance_n2,
            first_variance,
            forgetting: 1.0 + tick_s / AVERAGING_S,
            mean_weight: tick_s / (MEAN_S + tick_s),
            slip_in_doubt: true,
            noise_variance: 1.0,
            reading_variance_n2: force_variance_n2,
            ..Self::default()
        }
    }

    /// Corrects the `estimate` with one reading (f_t, f_n), N, of a tip in contact; `is_dragged` returns whether its
    /// motion allows stick.
    #[inline]
    pub fn correct(
        &mut self,
        estimate: &mut FrictionEstimate,
        force_n: &Vector2<f32>,
        is_dragged: impl FnOnce(Slip) -> bool,
    ) {
        if self.slip_in_doubt {
            self.observe_slip(estimate, force_n);
        }
        let normal_n = force_n.y;
        if normal_n < self.observable_n {
            estimate.sticks = false;
            return;
        }
        let excess_n = -estimate.slip.sign::<f32>() * force_n.x - estimate.coefficient * normal_n;
        let square_n2 = normal_n * normal_n;
        let mut variance_n2 = estimate.variance * square_n2;
        let noise_n2 = self.reading_variance_n2;
        let quiet_n2 = (self.noise_variance * square_n2).limited(LEAST_NOISE * noise_n2, noise_n2);
        let differs = excess_n * excess_n > DIFFERENT_SQUARE * (variance_n2 + quiet_n2);
        estimate.sticks = differs && excess_n < 0.0 && is_dragged(estimate.slip);
        if estimate.sticks {
            return;
        }
        if differs {
            // μ has changed.
            estimate.variance = self.first_variance;
            variance_n2 = estimate.variance * square_n2;
        }
        let innovation = excess_n / normal_n;
        let gain = variance_n2 / (variance_n2 + quiet_n2);
        let change = gain * innovation;
        estimate.coefficient = (estimate.coefficient + change).at_least(0.0);
        estimate.catch_up = MISSED_TICKS * change;
        self.correction = Some(Correction { innovation, gain });
    }

    /// Updates variances and slip of the `estimate` after the tip has touched at a tick, with its reading.
    #[inline]
    pub fn update(&mut self, estimate: &mut FrictionEstimate, force_n: &Vector2<f32>) {
        if let Some(correction) = self.correction.take() {
            self.adapt(estimate, correction, force_n.y);
        }
        estimate.catch_up = 0.0;
        estimate.variance = estimate.variance.at_most(self.first_variance);
        self.reading_variance_n2 =
            self.force_variance_n2 * (1.0 + estimate.coefficient * estimate.coefficient);
        // A reading that could decide has been considered before its tick was answered.
        if !self.slip_in_doubt {
            self.observe_slip(estimate, force_n);
        }
        self.slip_in_doubt = !estimate.slip_seen || self.contrary_ticks + 1 >= REVERSAL_TICKS;
    }

    /// Adapts the variances to a correction at this normal force, N.
    fn adapt(&mut self, estimate: &mut FrictionEstimate, correction: Correction, normal_n: f32) {
        let innovation = correction.innovation;
        let ratio_variance = self.reading_variance_n2 / (normal_n * normal_n);
        // A variance of zero would never grow again.
        let kept = (1.0 - correction.gain).at_least(f32::EPSILON);
        estimate.variance *= kept * self.forgetting;
        // Innovations that keep their sign are not noise: μ has changed.
        let weight = self.mean_weight;
        let change = innovation - self.innovation;
        self.innovation = innovation;
        let least_variance = LEAST_NOISE * ratio_variance;
        let most = NO_NOISE_SQUARE * (self.noise_variance + least_variance);
        // The difference of two innovations has twice the variance of one; its average takes four times as long.
        let square = (0.5 * change * change).at_most(most);
        self.noise_variance += 0.25 * weight * (square - self.noise_variance);
        let ratio_variance = self.noise_variance.limited(least_variance, ratio_variance);
        self.mean_innovation += weight * (innovation - self.mean_innovation);
        let square = self.mean_innovation * self.mean_innovation;
        if square > NO_NOISE_SQUARE * (estimate.variance + ratio_variance) * weight {
            estimate.variance = estimate.variance.at_least(square);
        }
    }

    #[inline(never)]
    fn observe_slip(&mut self, estimate: &mut FrictionEstimate, force_n: &Vector2<f32>) {
        let slip = Slip::of(-force_n.x);
        // Below the noise level the sign carries no information.
        let clear = force_n.x * force_n.x > NO_NOISE_SQUARE * self.force_variance_n2;
        let cone_n = REVERSAL_FRACTION * estimate.coefficient * force_n.y;
        let contrary = clear && slip != estimate.slip && force_n.x.abs() >= cone_n;
        self.contrary_ticks = if contrary { self.contrary_ticks + 1 } else { 0 };
        if self.contrary_ticks >= REVERSAL_TICKS || (clear && !estimate.slip_seen) {
            estimate.slip = slip;
            estimate.slip_seen = true;
            self.contrary_ticks = 0;
            estimate.sticks = false;
        }
    }

    /// Forgets how well μ is known: a tip that has left the belt may have been thrown off by more friction than
    /// estimated. It will land at rest, with the slip `at_rest` if that is known.
    pub fn leave(&mut self, estimate: &mut FrictionEstimate, at_rest: Option<Slip>) {
        self.contrary_ticks = 0;
        estimate.sticks = false;
        estimate.variance = self.first_variance;
        estimate.slip = at_rest.unwrap_or(estimate.slip);
    }
}

#[cfg(test)]
mod tests;

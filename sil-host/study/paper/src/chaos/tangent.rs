//! A small deviation of an orbit, and its growth.
//!
//! The variational equation δ̇ = Df δ and the jump of δ at an event, in directional
//! form: only derivatives along δ are needed, never a matrix, and every one of them is a
//! central difference of a function without a closed-form derivative: a step
//! of the integrator or the impact law. Differences of relative size 10⁻⁶ are
//! accurate to about nine digits.
//!
//! At an event, where the guard g is zero, the neighbour arrives dt = −(∇g·δ)/(∇g·f⁻)
//! later, is mapped by the jump R, and is compared at the same time again:
//!
//! ```text
//! δ⁺ = DR (δ⁻ + f⁻ dt) − f⁺ dt
//! ```
//!
//! which is the saltation matrix DR + (f⁺ − DR f⁻) ∇gᵀ/(∇g·f⁻) applied to δ⁻ (Aizerman and
//! Gantmakher 1958; Leine and Nijmeijer 2004, section 7.3).

use nalgebra::SVector;

/// Size of the central differences, relative to a state of order one.
const DIFFERENCE: f64 = 1e-6;

/// Ratio below which a map has annihilated a deviation: the remainder
/// is rounding.
const GONE: f64 = 1e-11;

/// Returns the derivative of `function` at `x` along `direction`.
pub fn along<const N: usize, const M: usize>(
    x: &SVector<f64, N>,
    direction: &SVector<f64, N>,
    function: impl FnMut(&SVector<f64, N>) -> SVector<f64, M>,
) -> SVector<f64, M> {
    along_by(DIFFERENCE, x, direction, function)
}

/// Returns the derivative as [`along`], with differences no larger than `size` or the default.
pub fn along_by<const N: usize, const M: usize>(
    size: f64,
    x: &SVector<f64, N>,
    direction: &SVector<f64, N>,
    mut function: impl FnMut(&SVector<f64, N>) -> SVector<f64, M>,
) -> SVector<f64, M> {
    let length = direction.norm();
    if length == 0.0 {
        return SVector::zeros();
    }
    let size = size.min(DIFFERENCE);
    let offset = direction * (size / length);
    (function(&(x + offset)) - function(&(x - offset))) * (0.5 * length / size)
}

/// Returns the derivative of the scalar `function` at `x` along `direction`.
pub fn slope_along<const N: usize>(
    x: &SVector<f64, N>,
    direction: &SVector<f64, N>,
    mut function: impl FnMut(&SVector<f64, N>) -> f64,
) -> f64 {
    along(x, direction, |x| SVector::<f64, 1>::new(function(x))).x
}

/// An event: the flow on both sides and the rate of its guard.
#[derive(Clone, Copy, Debug)]
pub struct Crossing<const N: usize> {
    /// Derivative of the state before the event.
    pub before: SVector<f64, N>,
    /// Derivative of the state after the event.
    pub after: SVector<f64, N>,
    /// Rate of the guard along the flow before, ∇g·f⁻.
    pub guard_rate: f64,
}

/// A deviation of unit length and the logarithm of the length divided out of it.
#[derive(Clone, Copy, Debug)]
pub struct Tangent<const N: usize> {
    direction: SVector<f64, N>,
    log_growth: f64,
}

impl<const N: usize> Default for Tangent<N> {
    fn default() -> Self {
        Self {
            direction: generic_direction(),
            log_growth: 0.0,
        }
    }
}

impl<const N: usize> Tangent<N> {
    /// Creates a deviation along a nonzero direction.
    pub fn along(direction: SVector<f64, N>) -> Self {
        let mut tangent = Self::default();
        tangent.take(direction);
        tangent
    }

    /// Returns the deviation with its length; infinite or zero on overflow or
    /// underflow.
    pub fn deviation(&self) -> SVector<f64, N> {
        self.direction * libm::exp(self.log_growth)
    }

    /// Returns the deviation, normalised to length one.
    pub fn direction(&self) -> &SVector<f64, N> {
        &self.direction
    }

    /// Propagates the deviation by a linear map.
    pub fn carry(&mut self, map: impl FnOnce(&SVector<f64, N>) -> SVector<f64, N>) {
        let image = map(&self.direction);
        self.take(image);
    }

    /// Propagates the deviation across an event: `guard` is the derivative of the event's
    /// guard along a direction, `jump` that of the map of the state.
    pub fn cross(
        &mut self,
        crossing: &Crossing<N>,
        guard: impl FnOnce(&SVector<f64, N>) -> f64,
        jump: impl FnOnce(&SVector<f64, N>) -> SVector<f64, N>,
    ) {
        self.carry(|deviation| {
            let later = -guard(deviation) / crossing.guard_rate;
            jump(&(deviation + crossing.before * later)) - crossing.after * later
        });
    }

    /// Removes the component along the flow `derivative`.
    pub fn remove_flow(&mut self, derivative: &SVector<f64, N>) {
        let square = derivative.norm_squared();
        if square > 0.0 {
            self.carry(|deviation| deviation - derivative * (derivative.dot(deviation) / square));
        }
    }

    /// Returns the logarithm of the growth since the last call; minus infinity if the deviation has
    /// vanished, for example during sticking. A new deviation has then been started.
    pub fn take_log_growth(&mut self) -> f64 {
        core::mem::take(&mut self.log_growth)
    }

    fn take(&mut self, image: SVector<f64, N>) {
        let length = image.norm();
        if length > GONE && length.is_finite() {
            self.direction = image / length;
            self.log_growth += libm::log(length);
        } else {
            self.direction = generic_direction();
            // NaN must not pass for growth.
            self.log_growth += if length.is_finite() {
                f64::NEG_INFINITY
            } else {
                f64::NAN
            };
        }
    }
}

/// Returns a direction that coincides with no axis or symmetry.
fn generic_direction<const N: usize>() -> SVector<f64, N> {
    SVector::<f64, N>::from_fn(|i, _| libm::sqrt((2 * i + 2) as f64) - i as f64).normalize()
}

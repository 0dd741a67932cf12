//! The scalar of the mechanics: `f32` or `f64` with elementary functions that
//! give the same bits on every host.
//!
//! IEEE 754 fixes addition, multiplication, division and square root, but not sine, cosine and
//! their inverses: C libraries round them differently. These functions therefore never come from
//! the host's library. In `f64` (plant) they come from the `libm` crate. In `f32` (controller) sine
//! and cosine are polynomials, because `libm` evaluates them in `f64`, which a Cortex-M4F computes
//! in software: about 2,100 instructions against a few dozen. The arc cosine has the bits of `libm`, with the
//! processor's square root.

use nalgebra::RealField;

use crate::arc_cosine::arc_cosine;
use crate::settings::SettingValue;
use crate::square_root::square_root;

/// A real number whose elementary functions do not depend on the host.
pub trait Real: RealField + Copy + SettingValue {
    /// Returns the number nearest to an `f64` literal.
    fn literal(value: f64) -> Self;

    /// Returns this number as `f64`, exact for `f32` and `f64`.
    fn to_f64(self) -> f64;

    /// Returns the number nearest to an integer; exact in `f32` up to 24 bits. The conversion
    /// avoids `f64`, which a Cortex-M4F computes in software.
    fn from_integer(value: i32) -> Self;
    /// Returns 2^−`exponent`, exactly; `exponent` is at most 126.
    fn negative_power_of_two(exponent: u8) -> Self;

    /// Returns the integer part; saturates, and NaN gives 0.
    fn truncate_to_i32(self) -> i32;

    /// Clamps this number to `minimum ..= maximum`; NaN stays NaN. Unlike the standard library's
    /// `clamp` it cannot panic.
    #[inline]
    fn limited(self, minimum: Self, maximum: Self) -> Self {
        if self < minimum {
            minimum
        } else if self > maximum {
            maximum
        } else {
            self
        }
    }

    /// Clamps this number to `±limit`, where `limit` is at least zero; NaN stays NaN.
    #[inline]
    fn within(self, limit: Self) -> Self {
        if self.abs() > limit {
            if self > Self::zero() { limit } else { -limit }
        } else {
            self
        }
    }

    /// Returns the lesser of this number and `maximum`; NaN stays NaN. This is one comparison; the
    /// standard library's `min` is a function call on a Cortex-M4F.
    #[inline]
    fn at_most(self, maximum: Self) -> Self {
        if self > maximum { maximum } else { self }
    }

    /// Returns the greater of this number and `minimum`; NaN stays NaN.
    #[inline]
    fn at_least(self, minimum: Self) -> Self {
        if self < minimum { minimum } else { self }
    }

    /// Sine and cosine of an angle in rad.
    fn sine_cosine(self) -> (Self, Self);

    /// Sines and cosines of two angles in rad: the same bits as one after the other, in less time on a Cortex-M4F.
    #[inline]
    fn sines_cosines(one: Self, other: Self) -> [(Self, Self); 2] {
        [one.sine_cosine(), other.sine_cosine()]
    }

    /// Arc cosine in rad; NaN outside -1 … 1.
    fn arc_cosine(self) -> Self;

    /// Angle of the point (`x`, `self`) in rad, -π … π.
    fn arc_tangent_2(self, x: Self) -> Self;

    /// Square root, correctly rounded; NaN below zero.
    fn square_root(self) -> Self;
}

/// Conversions that differ only in the type, with the bits of a number, the bias of its exponent and the length of its
/// fraction.
macro_rules! conversions {
    ($bits:ty, $bias:literal, $fraction:literal) => {
        #[inline]
        fn literal(value: f64) -> Self {
            value as Self
        }

        #[inline]
        fn to_f64(self) -> f64 {
            self as f64
        }

        #[inline]
        fn from_integer(value: i32) -> Self {
            value as Self
        }

        #[inline]
        fn negative_power_of_two(exponent: u8) -> Self {
            Self::from_bits(($bias - <$bits>::from(exponent & 127)) << $fraction)
        }

        #[inline]
        fn truncate_to_i32(self) -> i32 {
            self as i32
        }
    };
}

impl Real for f64 {
    conversions!(u64, 1023, 52);

    #[inline]
    fn sine_cosine(self) -> (Self, Self) {
        libm::sincos(self)
    }

    #[inline]
    fn arc_cosine(self) -> Self {
        libm::acos(self)
    }

    #[inline]
    fn arc_tangent_2(self, x: Self) -> Self {
        libm::atan2(self, x)
    }

    #[inline]
    fn square_root(self) -> Self {
        libm::sqrt(self)
    }
}

impl Real for f32 {
    conversions!(u32, 127, 23);

    #[inline]
    fn sine_cosine(self) -> (Self, Self) {
        sine_cosine_f32(self)
    }

    #[inline]
    fn sines_cosines(one: Self, other: Self) -> [(Self, Self); 2] {
        // Without a branch between the two, the constants of the polynomials stay in registers.
        if is_reducible(one) && is_reducible(other) {
            [reduced_sine_cosine(one), reduced_sine_cosine(other)]
        } else {
            [one.sine_cosine(), other.sine_cosine()]
        }
    }

    #[inline]
    fn arc_cosine(self) -> Self {
        arc_cosine(self)
    }

    #[inline]
    fn arc_tangent_2(self, x: Self) -> Self {
        libm::atan2f(self, x)
    }

    #[inline]
    fn square_root(self) -> Self {
        square_root(self)
    }
}

/// Largest angle (rad) that the three-part reduction below handles exactly. Unwrapped joint angles
/// stay far below it.
const REDUCTION_LIMIT_RAD: f32 = 8192.0;

/// 1.5 · 2²³: adding it to a number below 2²² rounds that number to an integer.
const ROUNDS_TO_INTEGER: f32 = 12_582_912.0;

/// Returns sine and cosine, computed in single precision only.
///
/// The angle is reduced to ±π/4 by Cody and Waite's three-part π/2; the minimax polynomials are
/// those of Cephes `sinf.c` (Moshier). The absolute error is below 1.2e-7, two units in the last
/// place of 1, for |angle| up to 8192 rad. Beyond that both results are NaN, on which the
/// controller latches a fault: a joint never turns that far, and an exact reduction would cost
/// thousands of instructions and 9 KiB of flash.
#[inline]
fn sine_cosine_f32(angle: f32) -> (f32, f32) {
    if is_reducible(angle) {
        reduced_sine_cosine(angle)
    } else {
        (f32::NAN, f32::NAN)
    }
}

/// Returns whether the reduction handles an angle.
#[inline]
fn is_reducible(angle: f32) -> bool {
    angle.abs() < REDUCTION_LIMIT_RAD
}

#[inline]
fn reduced_sine_cosine(angle: f32) -> (f32, f32) {
    const HALF_PI_HIGH: f32 = 1.570_312_5;
    const HALF_PI_MIDDLE: f32 = 4.837_513e-4;
    const HALF_PI_LOW: f32 = 7.549_79e-8;

    let turns = angle * core::f32::consts::FRAC_2_PI;
    // A number this large has no fraction bits, so the sum rounds to the nearest integer and holds
    // it in its last bits.
    let rounded = turns + ROUNDS_TO_INTEGER;
    let quadrant = rounded.to_bits();
    let k = rounded - ROUNDS_TO_INTEGER;
    let x = ((angle - k * HALF_PI_HIGH) - k * HALF_PI_MIDDLE) - k * HALF_PI_LOW;
    let z = x * x;
    let sine = ((-1.951_529_6e-4 * z + 8.332_161e-3) * z - 1.666_665_5e-1) * z * x + x;
    let cosine =
        ((2.443_315_7e-5 * z - 1.388_731_6e-3) * z + 4.166_664_6e-2) * z * z - 0.5 * z + 1.0;
    match quadrant & 3 {
        0 => (sine, cosine),
        1 => (cosine, -sine),
        2 => (-sine, -cosine),
        _ => (-cosine, sine),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{f32, format};

    /// Compares the polynomial with double precision over every angle a joint can have and over the
    /// whole range of the reduction.
    #[test]
    fn single_precision_sine_and_cosine_are_within_two_units_of_one() {
        let mut worst = 0.0_f64;
        let fine = (-400_000..=400_000).map(|i| i as f32 * 2.5e-5);
        let coarse = (-819_200..=819_200).map(|i| i as f32 * 0.01);
        for angle in fine.chain(coarse) {
            let (sine, cosine) = angle.sine_cosine();
            let exact = f64::from(angle);
            worst = worst
                .max((f64::from(sine) - libm::sin(exact)).abs())
                .max((f64::from(cosine) - libm::cos(exact)).abs());
        }
        assert!(worst < 1.2e-7, "{}", format!("worst error {worst:e}"));
    }

    #[test]
    fn negative_powers_of_two_are_exact() {
        let (mut single, mut double) = (1.0_f32, 1.0_f64);
        for exponent in 0..=126 {
            assert_eq!(f32::negative_power_of_two(exponent), single);
            assert_eq!(f64::negative_power_of_two(exponent), double);
            single *= 0.5;
            double *= 0.5;
        }
    }

    #[test]
    fn small_angles_keep_their_relative_accuracy() {
        for exponent in -30..0 {
            let angle = libm::ldexpf(1.3, exponent);
            let (sine, _) = angle.sine_cosine();
            let exact = libm::sin(f64::from(angle));
            assert!((f64::from(sine) - exact).abs() <= 1.2e-7 * exact.abs());
        }
    }

    #[test]
    fn huge_and_non_finite_angles_are_not_numbers() {
        for angle in [8193.0, -1.0e30, f32::NAN, f32::INFINITY] {
            let (sine, cosine) = angle.sine_cosine();
            assert!(sine.is_nan() && cosine.is_nan());
        }
    }
}

//! Integer readings and commands of the converters, and their scaling to physical units.
//!
//! Only integers cross the link. Each quantity has its own type, so a force cannot be scaled as an
//! angle. The plant uses the scalings in `f64`, the controller in `f32`.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::range::OutOfRange;
use crate::real::Real;
use crate::settings::{Bounds, Refused, SettingValue, Shape};
use crate::{check_setting, settings};

#[cfg(feature = "zero-copy")]
use {
    iceoryx2_bb_derive_macros::ZeroCopySend,
    iceoryx2_bb_elementary_traits::zero_copy_send::ZeroCopySend,
};

macro_rules! counts {
    ($(#[$documentation:meta])* $name:ident($integer:ty), $type_name:literal) => {
        $(#[$documentation])*
        #[repr(C)]
        #[derive(
            Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, Schema,
        )]
        #[cfg_attr(feature = "zero-copy", derive(ZeroCopySend))]
        #[cfg_attr(feature = "zero-copy", type_name($type_name))]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        pub struct $name(pub $integer);

        impl SettingValue for $name {
            const SHAPE: Shape = <$integer as SettingValue>::SHAPE;

            fn check(&self, bounds: &Bounds, error: &mut OutOfRange) -> Result<(), Refused> {
                self.0.check(bounds, error)
            }
        }
    };
}

counts!(
    /// Reading of an absolute single-turn joint encoder, 0 … 2^bits − 1.
    EncoderCounts(u32), "painleve::EncoderCounts");
counts!(
    /// Reading of one axis of the force cell, signed.
    ForceCounts(i32), "painleve::ForceCounts");
counts!(
    /// Command to one torque stage, signed.
    TorqueCounts(i32), "painleve::TorqueCounts");
counts!(
    /// Position along the belt in µm, for display and logs.
    Micrometres(i32), "painleve::Micrometres");

impl EncoderCounts {
    /// In place of a reading: out of every range, so that the controller counts it as a lapse.
    pub const MISSING: Self = Self(u32::MAX);
}

impl ForceCounts {
    /// In place of a reading, as [`EncoderCounts::MISSING`].
    pub const MISSING: Self = Self(i32::MAX);
}

impl Micrometres {
    /// Rounds to a whole number of µm; saturates, and NaN gives 0.
    #[inline]
    pub fn from_metres(metres: f32) -> Self {
        Self(round_to_i32(metres * 1e6))
    }

    /// Returns this position in m.
    #[inline]
    pub fn to_metres(self) -> f64 {
        // Unlike the product with 1e-6, the quotient is the number nearest to the decimal.
        f64::from(self.0) / 1e6
    }
}

/// Rounds half away from zero; saturates, and NaN gives 0.
#[inline]
fn round_to_i32<T: Real>(value: T) -> i32 {
    (value + T::literal(0.5).copysign(value)).truncate_to_i32()
}

/// Rounds half away from zero, exactly; saturates, and NaN gives 0.
#[inline]
fn round_to_i64(value: f64) -> i64 {
    let whole = value as i64;
    let rest = value - whole as f64;
    whole.saturating_add(i64::from(rest >= 0.5) - i64::from(rest <= -0.5))
}

settings! {
    /// A joint encoder: resolution and mounting offset.
    #[derive(Copy, Eq)]
    pub struct EncoderScale {
        /// Resolution: 2^bits counts per turn. Beyond 24 bits a single-precision angle no longer
        /// resolves a count.
        bits: u8 = 14, 8..=24, "bits";
        /// Reading at angle zero; less than one turn.
        offset: EncoderCounts = EncoderCounts(0), 0..=(1 << 24) - 1, "counts";
    }
    check Self::relations;
}

impl EncoderScale {
    fn relations(&self) -> Result<(), OutOfRange> {
        check_setting!(self.offset, 0, self.modulus() - 1)
    }

    /// Returns the counts per turn, 2^bits.
    #[inline]
    pub fn modulus(&self) -> u32 {
        1 << (self.bits & 31)
    }

    /// One count, rad.
    #[inline]
    pub fn rad_per_count<T: Real>(&self) -> T {
        // Exactly 2π/2^bits, without a division.
        T::literal(core::f64::consts::TAU * f64::negative_power_of_two(self.bits & 31))
    }

    /// Returns whether an encoder of this resolution can give this reading.
    #[inline]
    pub fn contains(&self, reading: EncoderCounts) -> bool {
        reading.0 < self.modulus()
    }

    /// Returns the reading nearest to an angle in rad (any number of turns).
    pub fn reading(&self, angle_rad: f64) -> EncoderCounts {
        let counts = round_to_i64(angle_rad / self.rad_per_count::<f64>());
        let reading = counts.wrapping_add(self.offset.0.into());
        // The remainder of a division by a power of two, also below zero.
        EncoderCounts(reading as u32 & (self.modulus() - 1))
    }

    /// Returns the counts from angle zero to a reading, the short way round: −2^(bits−1) …
    /// 2^(bits−1) − 1.
    #[inline]
    pub fn counts_from_zero(&self, reading: EncoderCounts) -> i32 {
        self.shortest_way(reading.0.wrapping_sub(self.offset.0))
    }

    /// Returns the counts from one reading to the next, the short way round.
    #[inline]
    pub fn difference(&self, from: EncoderCounts, to: EncoderCounts) -> i32 {
        self.shortest_way(to.0.wrapping_sub(from.0))
    }

    #[inline]
    fn shortest_way(&self, counts: u32) -> i32 {
        let unused = 32 - u32::from(self.bits & 31);
        // Shifting up and back extends the sign of a number of `bits` bits.
        ((counts << (unused & 31)) as i32) >> (unused & 31)
    }
}

settings! {
    /// A converter that is linear over ±`range`: a force cell or a torque stage.
    #[derive(Copy)]
    pub struct LinearScale<T: Real> {
        /// Resolution: 2^bits counts over the whole range. Beyond 22 bits single precision no
        /// longer resolves a count.
        bits: u8 = 12, 4..=22, "bits";
        /// Full scale in either direction, in the quantity's unit (N or N·m).
        range: T = T::one(), 1e-3..=1e6;
    }
}

impl<T: Real> LinearScale<T> {
    /// One count in the quantity's unit.
    #[inline]
    pub fn per_count(&self) -> T {
        // Exactly range / 2^(bits − 1), without a division.
        self.range * T::negative_power_of_two((self.bits & 31).wrapping_sub(1))
    }

    /// Returns the largest reading, 2^(bits−1) − 1; the smallest is −2^(bits−1).
    #[inline]
    pub fn maximum_counts(&self) -> i32 {
        (1_i32 << ((self.bits & 31).wrapping_sub(1) & 31)).wrapping_sub(1)
    }

    /// Returns the converter of this scale.
    #[inline]
    pub fn converter(&self) -> LinearConverter<T> {
        LinearConverter {
            per_count: self.per_count(),
            maximum_counts: self.maximum_counts(),
        }
    }

    /// Returns whether a converter of this resolution can give or take this reading.
    #[inline]
    pub fn contains(&self, counts: i32) -> bool {
        self.converter().contains(counts)
    }

    /// Returns the nearest reading, and whether it was clamped; NaN gives 0.
    #[inline]
    pub fn counts(&self, value: T) -> (i32, bool) {
        self.converter().counts(value)
    }

    /// Returns the value of a reading in the quantity's unit.
    #[inline]
    pub fn value(&self, counts: i32) -> T {
        self.converter().value(counts)
    }
}

/// What a conversion needs of a [`LinearScale`], computed once rather than at every tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearConverter<T> {
    /// One count in the quantity's unit.
    pub per_count: T,
    /// The largest reading. The smallest is its complement, which is further from zero by one.
    pub maximum_counts: i32,
}

impl<T: Real> LinearConverter<T> {
    /// Returns whether the converter can give or take this reading.
    #[inline]
    pub fn contains(&self, counts: i32) -> bool {
        let size = if counts < 0 { !counts } else { counts };
        size <= self.maximum_counts
    }

    /// Returns the nearest whole number of counts, even if it is none of the converter's readings; NaN gives 0.
    #[inline]
    pub fn nearest(&self, value: T) -> i32 {
        round_to_i32(value / self.per_count)
    }

    /// Returns the nearest reading, and whether it was clamped; NaN gives 0.
    #[inline]
    pub fn counts(&self, value: T) -> (i32, bool) {
        let wanted = self.nearest(value);
        // Unlike `clamp`, this cannot panic.
        let counts = wanted.max(!self.maximum_counts).min(self.maximum_counts);
        (counts, counts != wanted)
    }

    /// Returns the value of a reading in the quantity's unit.
    #[inline]
    pub fn value(&self, counts: i32) -> T {
        // Exact: a reading has at most 22 bits.
        T::from_integer(counts) * self.per_count
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_14_bit_encoder_resolves_383_microradians() {
        let encoder = EncoderScale {
            bits: 14,
            offset: EncoderCounts(0),
        };
        assert!((encoder.rad_per_count::<f64>() - 0.383e-3).abs() < 1e-6);
        assert_eq!(encoder.reading(-0.383e-3), EncoderCounts(16383));
        assert_eq!(encoder.counts_from_zero(EncoderCounts(16383)), -1);
    }

    #[test]
    fn a_12_bit_torque_stage_saturates_and_says_so() {
        let stage = LinearScale {
            bits: 12,
            range: 5.0_f32,
        };
        assert_eq!(stage.counts(7.0), (2047, true));
        assert_eq!(stage.counts(-5.0), (-2048, false));
        assert_eq!(stage.counts(f32::NAN), (0, false));
        assert!(!stage.contains(2048));
    }

    #[test]
    fn integers_are_rounded_as_by_the_library() {
        let numbers = [
            0.0,
            -0.0,
            0.5,
            -0.5,
            1.5,
            -2.5,
            0.499_999_999_999_999_94,
            -0.499_999_999_999_999_94,
            1e-300,
            4.503_599_627_370_495_5e15,
            9e15,
            1e18,
            1e30,
            -1e30,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::NAN,
        ];
        for number in numbers {
            assert_eq!(round_to_i64(number), libm::round(number) as i64, "{number}");
        }
    }

    proptest! {
        #[test]
        fn encoder_readings_round_trip_within_half_a_count(
            angle in -3.1_f64..3.1, bits in 8_u8..=24, offset in 0_u32..256,
        ) {
            let encoder = EncoderScale { bits, offset: EncoderCounts(offset) };
            let reading = encoder.reading(angle);
            prop_assert!(encoder.contains(reading));
            let lsb: f64 = encoder.rad_per_count();
            let back = f64::from(encoder.counts_from_zero(reading)) * lsb;
            prop_assert!((back - angle).abs() <= 0.5 * lsb * (1.0 + 1e-9));
        }

        #[test]
        fn differences_go_the_short_way_round_the_turn(
            start in 0_u32..16384, step in -8192_i32..8192,
        ) {
            let encoder = EncoderScale { bits: 14, offset: EncoderCounts(77) };
            let end = (start as i32 + step).rem_euclid(16384) as u32;
            prop_assert_eq!(encoder.difference(EncoderCounts(start), EncoderCounts(end)), step);
        }

        #[test]
        fn linear_readings_round_trip_exactly(bits in 4_u8..=22, fraction in -1.0_f64..1.0) {
            let single = LinearScale { bits, range: 5.0_f32 };
            let double = LinearScale { bits, range: 5.0_f64 };
            let (counts, limited) = double.counts(fraction * 4.999);
            prop_assert!(double.contains(counts));
            if !limited {
                prop_assert!((double.value(counts) - fraction * 4.999).abs() <= 0.5001 * double.per_count());
            }
            // The controller's scaling returns the same integer.
            prop_assert_eq!(single.counts(single.value(counts)), (counts, false));
        }
    }
}

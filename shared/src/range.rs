//! Range errors: which key, which value, what is allowed.

use crate::Real;

/// A parameter outside its allowed range; NaN and infinities are always outside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutOfRange {
    /// Full name of the key with its unit, as in a scenario file.
    pub key: &'static str,
    /// The value that was given.
    pub value: f64,
    /// Smallest allowed value.
    pub minimum: f64,
    /// Largest allowed value.
    pub maximum: f64,
}

impl core::fmt::Display for OutOfRange {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(
            f,
            "{} = {} is outside the allowed range {} to {}",
            self.key,
            Shortest(self.value),
            Shortest(self.minimum),
            Shortest(self.maximum)
        )
    }
}

/// A number as it was written: one that is exact in `f32` with the digits of an `f32`.
struct Shortest(f64);

impl core::fmt::Display for Shortest {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let single = self.0 as f32;
        if f64::from(single) == self.0 {
            single.fmt(f)
        } else {
            self.0.fmt(f)
        }
    }
}

impl core::error::Error for OutOfRange {}

/// Accepts `value` if it is finite and within `minimum ..= maximum`.
///
/// # Errors
/// [`OutOfRange`] naming `key` otherwise.
pub fn check<T: Real>(
    key: &'static str,
    value: T,
    minimum: f64,
    maximum: f64,
) -> Result<(), OutOfRange> {
    let value = value.to_f64();
    // In the value's precision: 0.1 is allowed where 0.1 is the bound.
    let minimum = T::literal(minimum).to_f64();
    let maximum = T::literal(maximum).to_f64();
    if value.is_finite() && (minimum..=maximum).contains(&value) {
        Ok(())
    } else {
        Err(OutOfRange {
            key,
            value,
            minimum,
            maximum,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    #[test]
    fn the_message_names_key_value_and_range() {
        let error = check("arm.link_mass_kg", f32::NAN, 0.001, 100.0).unwrap_err();
        assert_eq!(
            error.to_string(),
            "arm.link_mass_kg = NaN is outside the allowed range 0.001 to 100"
        );
    }

    #[test]
    fn single_precision_bounds_are_met_and_shown_as_written() {
        assert!(check("x", 0.1_f32, 0.1, 1.0).is_ok());
        let error = check("x", 0.5_f32, 0.1, 0.42).unwrap_err();
        assert_eq!(
            error.to_string(),
            "x = 0.5 is outside the allowed range 0.1 to 0.42"
        );
    }

    #[test]
    fn bounds_are_allowed_and_infinities_are_not() {
        assert!(check("x", 1.0, 0.0, 1.0).is_ok());
        assert!(check("x", f64::INFINITY, 0.0, f64::INFINITY).is_err());
    }
}

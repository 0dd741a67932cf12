//! Range errors, which name the key, the value and the allowed range.

use core::fmt::{self, Write};

use nalgebra::{RealField, convert, try_convert};

/// A number outside its allowed range; NaN and infinities are always outside.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OutOfRange {
    /// The setting's key.
    pub key: Key,
    /// The value given.
    pub value: f64,
    /// Smallest allowed value.
    pub minimum: f64,
    /// Largest allowed value.
    pub maximum: f64,
}

impl OutOfRange {
    /// Returns the error with its key prefixed by `name`, the group that holds the setting.
    #[must_use]
    pub fn inside(mut self, name: &'static str) -> Self {
        self.enclose(name);
        self
    }

    /// Does the same as [`inside`](Self::inside), in place.
    #[inline(never)]
    pub fn enclose(&mut self, name: &'static str) {
        if let Some(place) = self.key.parts.iter_mut().find(|part| part.is_empty()) {
            *place = name;
        }
    }

    /// Returns the error with its key prefixed by `index`, the position (from 0) of the value in a
    /// list. Indices beyond 15 are shown as `*`.
    #[must_use]
    pub fn at(self, index: usize) -> Self {
        self.inside(index_name(index))
    }
}

impl fmt::Display for OutOfRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
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

impl core::error::Error for OutOfRange {}

/// Largest number of parts in a key. Further parts are dropped, outermost first.
const MAXIMUM_PARTS: usize = 6;

/// Indices as parts of a key: static text, so that no heap is needed.
const INDICES: [&str; 16] = [
    "0", "1", "2", "3", "4", "5", "6", "7", "8", "9", "10", "11", "12", "13", "14", "15",
];

/// Returns an index as a part of a key.
pub(crate) fn index_name(index: usize) -> &'static str {
    INDICES.get(index).copied().unwrap_or("*")
}

/// Path of a value from the outermost group to the setting, as in a scenario file:
/// `controller.law.hybrid.normal_force_n`.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
pub struct Key {
    /// Parts from the setting outwards; unused ones are empty.
    parts: [&'static str; MAXIMUM_PARTS],
}

impl Key {
    /// Returns the parts from the outermost group to the setting.
    pub fn parts(&self) -> impl Iterator<Item = &'static str> {
        self.parts.into_iter().rev().filter(|part| !part.is_empty())
    }
}

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, part) in self.parts().enumerate() {
            if index > 0 {
                f.write_char('.')?;
            }
            f.write_str(part)?;
        }
        Ok(())
    }
}

impl fmt::Debug for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "\"{self}\"")
    }
}

impl PartialEq<&str> for Key {
    fn eq(&self, other: &&str) -> bool {
        let mut rest = Rest(other);
        write!(rest, "{self}").is_ok() && rest.0.is_empty()
    }
}

/// The part of a text that has not been compared yet.
struct Rest<'a>(&'a str);

impl Write for Rest<'_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.0 = self.0.strip_prefix(text).ok_or(fmt::Error)?;
        Ok(())
    }
}

/// A number with the shortest digits that give it back: those of an `f32` if it is exact in `f32`.
pub struct Shortest(pub f64);

impl fmt::Display for Shortest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let single = self.0 as f32;
        if f64::from(single) == self.0 {
            single.fmt(f)
        } else {
            self.0.fmt(f)
        }
    }
}

/// Accepts `value` if it is finite and within `minimum ..= maximum`.
///
/// # Errors
/// [`OutOfRange`] naming `key` otherwise.
#[inline]
pub fn check<T: RealField + Copy>(
    key: &'static str,
    value: T,
    minimum: f64,
    maximum: f64,
) -> Result<(), OutOfRange> {
    if is_within(value, minimum, maximum) {
        Ok(())
    } else {
        Err(refused(try_convert(value).unwrap_or(f64::NAN), minimum, maximum).inside(key))
    }
}

/// Returns whether `value` is finite and within `minimum ..= maximum`.
#[inline]
pub(crate) fn is_within<T: RealField + Copy>(value: T, minimum: f64, maximum: f64) -> bool {
    // Compare in the value's own precision: the bound 0.1 then allows the single-precision 0.1, and
    // a microcontroller without double precision compares single-precision numbers.
    value >= convert(minimum) && value <= convert(maximum) && value.is_finite()
}

#[cold]
#[inline(never)]
fn refused(value: f64, minimum: f64, maximum: f64) -> OutOfRange {
    OutOfRange {
        key: Key::default(),
        value,
        minimum,
        maximum,
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

    #[test]
    fn keys_grow_from_the_setting_outwards() {
        let error = check("target_m", 9.0, 0.0, 1.0).unwrap_err();
        let key = error.inside("ramp").at(2).inside("reference").key;
        assert_eq!(key.to_string(), "reference.2.ramp.target_m");
        assert_eq!(key, "reference.2.ramp.target_m");
        assert!(key != "reference.2.ramp" && key != "reference.2.ramp.target_mm");
        assert_eq!(key.parts().next(), Some("reference"));
        assert_eq!(Key::default().parts().next(), None);
    }

    #[test]
    fn a_key_that_is_too_deep_loses_its_outermost_parts() {
        let error = check("x", 9.0, 0.0, 1.0).unwrap_err();
        let key = (0..20).fold(error, OutOfRange::at).key;
        assert_eq!(key, "4.3.2.1.0.x");
    }
}

//! Settings declared once, with name, type, default, allowed range, unit and meaning.
//!
//! From one declaration the macro [`settings!`](crate::settings!) generates the struct with its
//! documentation, `Default`, serde, the check of every range, and a description of the settings from
//! which a host generates commented files, schemas and tables. It needs no heap and works in any crate,
//! for example for a custom control law:
//!
//! ```
//! use painleve_shared::settings::Settings;
//!
//! painleve_shared::settings! {
//!     /// Settings of an impedance controller.
//!     #[derive(Copy)]
//!     pub struct ImpedanceSettings {
//!         /// Stiffness along the belt.
//!         stiffness_n_m: f32 = 200.0, 0.0..=1e5, "N/m";
//!         /// Damping along the belt.
//!         damping_ns_m: f32 = 10.0, 0.0..=1e4, "N·s/m";
//!         /// Whether gravity is compensated.
//!         compensate_gravity: bool = true;
//!     }
//! }
//!
//! let settings = ImpedanceSettings { damping_ns_m: -1.0, ..Default::default() };
//! let error = settings.validate().unwrap_err();
//! assert_eq!(error.key, "damping_ns_m");
//! assert_eq!(ImpedanceSettings::FIELDS[0].unit, "N/m");
//! ```
//!
//! A choice is an enum. Each variant is declared with its name in files:
//!
//! ```
//! painleve_shared::settings! {
//!     /// Where the friction that a law compensates comes from.
//!     #[derive(Copy)]
//!     pub enum FeedForward = Measured {
//!         /// The last reading.
//!         "measured" => Measured,
//!         /// The reading through a low-pass.
//!         "filtered" => Filtered {
//!             /// Time constant.
//!             time_constant_s: f32, 0.0..=10.0, "s";
//!         },
//!     }
//! }
//! ```
//!
//! A bound that depends on another setting is checked in a function. The declaration names it after the
//! braces (`check Self::relations;`), and it uses [`check_setting!`](crate::check_setting!).

mod declare;

#[doc(hidden)]
pub use declare::{check_named, in_variant};
pub use serde;

use crate::range::{Key, OutOfRange, index_name, is_within};

/// A group of settings, implemented by [`settings!`](crate::settings!).
pub trait Settings: SettingValue {
    /// Every setting of the group, in the order of the declaration.
    const FIELDS: &'static [Field];

    /// Checks every setting, those of nested groups included.
    ///
    /// # Errors
    /// [`OutOfRange`] for the first setting that is out of range, with a key relative to the group.
    fn validate(&self) -> Result<(), OutOfRange> {
        let mut error = OutOfRange::default();
        match self.check(&Bounds::NONE, &mut error) {
            Ok(()) => Ok(()),
            Err(Refused) => Err(error),
        }
    }
}

/// Description of one setting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Field {
    /// Name, including the unit's suffix.
    pub key: &'static str,
    /// Meaning, in one sentence.
    pub meaning: &'static str,
    /// Unit; empty for a dimensionless number and for a setting that is not a number.
    pub unit: &'static str,
    /// Allowed values of a number, or of each number in an array. Other settings may narrow this range.
    pub range: Option<Range>,
    /// Kind of value.
    pub shape: Shape,
}

/// Smallest and largest allowed value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Smallest allowed value.
    pub minimum: f64,
    /// Largest allowed value.
    pub maximum: f64,
}

/// Key and bounds for the check of one setting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Name in the error.
    pub key: &'static str,
    /// Allowed values, of numbers.
    pub range: Option<Range>,
}

impl Bounds {
    /// Bounds of a value without a name.
    const NONE: Self = Self {
        key: "",
        range: None,
    };

    /// Returns the bounds of a setting of type `T`: a number without a range does not compile.
    #[doc(hidden)]
    pub const fn declared<T: SettingValue>(key: &'static str, range: Option<Range>) -> Self {
        assert!(
            range.is_some() || !T::SHAPE.needs_a_range(),
            "a setting that is a number needs a range"
        );
        Self { key, range }
    }
}

/// The kind of a setting's values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// True or false.
    Switch,
    /// A whole number of the named type.
    Integer(&'static str),
    /// A number of the named type.
    Number(&'static str),
    /// Text.
    Text,
    /// A table of further settings.
    Group(&'static [Field]),
    /// One of several variants.
    Choice {
        /// Key that holds the variant's name. Without it a variant with settings is a table with one key,
        /// the variant's name.
        tag: Option<&'static str>,
        /// The variants.
        variants: &'static [Variant],
    },
    /// A value that may be absent.
    Optional(&'static Shape),
    /// A fixed number of values.
    Array {
        /// Kind of each value.
        item: &'static Shape,
        /// Number of values.
        length: usize,
    },
    /// Any number of values up to a limit.
    List {
        /// Kind of each value.
        item: &'static Shape,
        /// Largest number of values.
        maximum_length: usize,
    },
    /// A kind that only the running program knows, such as that of the set of laws it was built with.
    AtRunTime(ShapeSource),
}

/// Gives a [`Shape`] when the program runs.
#[derive(Clone, Copy, Debug)]
pub struct ShapeSource(pub fn() -> Shape);

impl PartialEq for ShapeSource {
    /// Compares the shapes: addresses of functions are not unique.
    fn eq(&self, other: &Self) -> bool {
        (self.0)() == (other.0)()
    }
}

impl Shape {
    /// Returns the kind itself in place of [`Shape::AtRunTime`].
    pub fn resolved(self) -> Self {
        match self {
            Self::AtRunTime(ShapeSource(shape)) => shape(),
            known => known,
        }
    }

    const fn needs_a_range(&self) -> bool {
        match self {
            Self::Number(_) => true,
            Self::Optional(inner) => inner.needs_a_range(),
            Self::Array { item, .. } | Self::List { item, .. } => item.needs_a_range(),
            _ => false,
        }
    }
}

/// One variant of a choice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Variant {
    /// Name in files.
    pub key: &'static str,
    /// Meaning.
    pub meaning: &'static str,
    /// Settings of the variant: a group or another choice.
    pub content: Option<Shape>,
    /// Whether all of its settings must be given because they have no defaults.
    pub complete: bool,
}

/// A type of setting.
pub trait SettingValue {
    /// Kind of its values.
    const SHAPE: Shape;

    /// Checks the value, or every value inside, against its bounds.
    ///
    /// # Errors
    /// [`Refused`] with the details in `error`, whose key begins with that of `bounds`.
    fn check(&self, bounds: &Bounds, error: &mut OutOfRange) -> Result<(), Refused>;
}

/// A value is out of range. The details are written in place: returned as results, the errors of all
/// settings of a group would be on a microcontroller's stack at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refused;

/// Adds a name to the key of an error.
#[doc(hidden)]
#[cold]
pub fn named(error: &mut OutOfRange, name: &'static str) -> Refused {
    error.enclose(name);
    Refused
}

macro_rules! numbers {
    ($shape:ident: $($number:ty as $real:ty),*) => {$(
        impl SettingValue for $number {
            const SHAPE: Shape = Shape::$shape(stringify!($number));

            // A single copy for all settings saves flash.
            #[inline(never)]
            fn check(&self, bounds: &Bounds, error: &mut OutOfRange) -> Result<(), Refused> {
                let value = *self as $real;
                match bounds.range {
                    Some(range) if !is_within(value, range.minimum, range.maximum) => {
                        *error = OutOfRange {
                            key: Key::default(),
                            value: f64::from(value),
                            minimum: range.minimum,
                            maximum: range.maximum,
                        };
                        Err(named(error, bounds.key))
                    }
                    _ => Ok(()),
                }
            }
        }
    )*};
}

numbers!(Number: f32 as f32, f64 as f64);
numbers!(Integer: u8 as f32, u16 as f32, u32 as f64, u64 as f64, i16 as f32, i32 as f64);

macro_rules! without_a_range {
    ($($type:ty: $shape:ident),*) => {$(
        impl SettingValue for $type {
            const SHAPE: Shape = Shape::$shape;

            #[inline]
            fn check(&self, _: &Bounds, _: &mut OutOfRange) -> Result<(), Refused> {
                Ok(())
            }
        }
    )*};
}

without_a_range!(bool: Switch);
#[cfg(feature = "alloc")]
without_a_range!(alloc::string::String: Text);

impl<T: SettingValue> SettingValue for Option<T> {
    const SHAPE: Shape = Shape::Optional(&T::SHAPE);

    fn check(&self, bounds: &Bounds, error: &mut OutOfRange) -> Result<(), Refused> {
        self.as_ref()
            .map_or(Ok(()), |value| value.check(bounds, error))
    }
}

impl<T: SettingValue, const N: usize> SettingValue for [T; N] {
    const SHAPE: Shape = Shape::Array {
        item: &T::SHAPE,
        length: N,
    };

    fn check(&self, bounds: &Bounds, error: &mut OutOfRange) -> Result<(), Refused> {
        check_each(self, bounds, error)
    }
}

/// Checks every value of a list; the keys are the values' indices.
///
/// # Errors
/// [`Refused`] for the first value that is out of range.
#[inline(never)]
pub fn check_each<T: SettingValue>(
    values: &[T],
    bounds: &Bounds,
    error: &mut OutOfRange,
) -> Result<(), Refused> {
    let range = bounds.range;
    for (index, value) in values.iter().enumerate() {
        let key = index_name(index);
        value
            .check(&Bounds { key, range }, error)
            .map_err(|Refused| named(error, bounds.key))?;
    }
    Ok(())
}
#[cfg(test)]
mod tests {
    use super::*;
    use crate::{check_setting, settings};
    use std::string::ToString;

    settings! {
        /// Settings of a gripper.
        #[derive(Copy)]
        pub struct GripperSettings {
            /// Whether it grips
            /// at all.
            enabled: bool = true;
            /// Force of each finger.
            force_n: [f32; 2] = [1.0, 2.0], 0.0..=10.0, "N";
            /// Attempts.
            attempts: u8 = 3, 0..=5;
            /// Fastest closing.
            fastest_m_s: f32 = 0.2, 1e-3..=1.0, "m/s";
            /// Speed of closing if it is known; at most `fastest_m_s`.
            speed_m_s: Option<f32> = None, 0.0..=1.0, "m/s";
            /// How it closes.
            closing: Closing = Closing::Soft { time_s: 0.1 };
            /// How it opens.
            opening: Opening = Opening::Spring {};
        }
        check Self::relations;
    }

    settings! {
        /// How a gripper closes.
        #[derive(Copy)]
        pub enum Closing = Hard {
            /// At once.
            "hard" => Hard,
            /// Slowly.
            "soft" => Soft {
                /// How long it takes.
                time_s: f32, 0.0..=1.0, "s";
            },
            /// As another does.
            "like" => Like(Inner),
        }
    }

    settings! {
        /// How a gripper opens.
        #[derive(Copy)]
        pub enum Opening by "kind" {
            /// By its spring.
            "spring" => Spring {},
            /// By its drive.
            "driven" => Driven {
                /// Speed.
                speed_m_s: f64, 0.0..=1.0, "m/s";
            },
        }
    }

    settings! {
        /// Settings inside a variant.
        #[derive(Copy)]
        pub struct Inner {
            /// Number of teeth.
            teeth: u32 = 1, 1..=9;
        }
    }

    impl GripperSettings {
        fn relations(&self) -> Result<(), OutOfRange> {
            check_setting!(self.speed_m_s, 0.0, self.fastest_m_s)
        }
    }

    fn message(change: impl FnOnce(&mut GripperSettings)) -> std::string::String {
        let mut settings = GripperSettings::default();
        assert_eq!(settings.validate(), Ok(()));
        change(&mut settings);
        settings.validate().unwrap_err().to_string()
    }

    #[test]
    fn every_kind_of_setting_is_checked_and_named() {
        let outside = "is outside the allowed range";
        assert_eq!(
            message(|it| it.force_n[1] = 10.5),
            std::format!("force_n.1 = 10.5 {outside} 0 to 10")
        );
        assert_eq!(
            message(|it| it.attempts = 6),
            std::format!("attempts = 6 {outside} 0 to 5")
        );
        assert_eq!(
            message(|it| it.speed_m_s = Some(f32::NAN)),
            std::format!("speed_m_s = NaN {outside} 0 to 1")
        );
        assert_eq!(
            message(|it| it.speed_m_s = Some(0.5)),
            std::format!("speed_m_s = 0.5 {outside} 0 to 0.2")
        );
        assert_eq!(
            message(|it| it.closing = Closing::Soft { time_s: -1.0 }),
            std::format!("closing.soft.time_s = -1 {outside} 0 to 1")
        );
        assert_eq!(
            message(|it| it.closing = Closing::Like(Inner { teeth: 0 })),
            std::format!("closing.like.teeth = 0 {outside} 1 to 9")
        );
        assert_eq!(
            message(|it| it.opening = Opening::Driven { speed_m_s: 2.0 }),
            std::format!("opening.speed_m_s = 2 {outside} 0 to 1")
        );
    }

    #[test]
    fn the_description_matches_the_declaration() {
        let keys: std::vec::Vec<_> = GripperSettings::FIELDS.iter().map(|it| it.key).collect();
        assert_eq!(
            keys,
            [
                "enabled",
                "force_n",
                "attempts",
                "fastest_m_s",
                "speed_m_s",
                "closing",
                "opening"
            ]
        );
        let [enabled, force, attempts, ..] = GripperSettings::FIELDS else {
            panic!("too few");
        };
        assert_eq!(enabled.meaning, "Whether it grips at all.");
        assert_eq!((enabled.range, enabled.shape), (None, Shape::Switch));
        assert_eq!((force.unit, attempts.unit), ("N", ""));
        let item = &Shape::Number("f32");
        assert_eq!(force.shape, Shape::Array { item, length: 2 });
        let Shape::Choice { tag, variants } = Closing::SHAPE else {
            panic!("not a choice");
        };
        assert_eq!((tag, variants[0].content), (None, None));
        assert_eq!(Closing::Soft { time_s: 0.0 }.name(), "soft");
        assert_eq!(
            variants[2].content,
            Some(Shape::Group(Inner::FIELDS)),
            "{variants:?}"
        );
    }

    #[test]
    fn defaults_match_the_declaration_and_survive_the_wire() {
        let settings = GripperSettings {
            speed_m_s: Some(0.1),
            closing: Closing::default(),
            ..Default::default()
        };
        assert_eq!((settings.attempts, settings.closing), (3, Closing::Hard));
        // Internally tagged enums require a self-describing format.
        let part = (settings.force_n, settings.speed_m_s, settings.closing);
        let mut buffer = [0; 64];
        let bytes = postcard::to_slice(&part, &mut buffer).unwrap();
        assert_eq!(postcard::from_bytes(bytes), Ok(part));
    }
}

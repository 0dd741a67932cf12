//! Hash of what the bytes of messages and of a configuration mean: names, types, units, ranges and order.
//!
//! Neither carries names, so a host and a board that disagree on them might read a number as its neighbour. Both compare
//! this hash first. Comments, defaults and the code around them do not change it.

use postcard_schema::Schema;
use postcard_schema::key::Key;

use crate::message::{Request, Response};
use crate::settings::{Field, Range, Shape, Variant};

/// FNV-1a hash, 64 bits, of messages and settings, computed by the compiler.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SchemaHash(u64);

impl SchemaHash {
    /// Returns the hash of all messages between a host and a board.
    pub const fn of_messages() -> Self {
        Self::of_type::<(Request<'static>, Response)>()
    }

    const fn of_type<T: Schema>() -> Self {
        Self(u64::from_le_bytes(Key::for_path::<T>("").to_bytes()))
    }

    /// Adds a named setting or group of settings.
    #[must_use]
    pub const fn value(self, key: &str, shape: &Shape) -> Self {
        self.text(key).shape(shape)
    }

    /// Returns the hash.
    pub const fn finish(self) -> u64 {
        self.0
    }

    const fn byte(self, byte: u8) -> Self {
        Self((self.0 ^ byte as u64).wrapping_mul(0x0100_0000_01b3))
    }

    const fn number(mut self, number: u64) -> Self {
        let bytes = number.to_le_bytes();
        let mut index = 0;
        while index < bytes.len() {
            self = self.byte(bytes[index]);
            index += 1;
        }
        self
    }

    /// The length comes first, so that neighbouring texts cannot exchange their ends.
    const fn text(self, text: &str) -> Self {
        let bytes = text.as_bytes();
        let mut hash = self.number(bytes.len() as u64);
        let mut index = 0;
        while index < bytes.len() {
            hash = hash.byte(bytes[index]);
            index += 1;
        }
        hash
    }

    const fn shape(self, shape: &Shape) -> Self {
        match shape {
            Shape::Switch => self.byte(0),
            Shape::Integer(name) | Shape::Number(name) => self.byte(1).text(name),
            Shape::Text => self.byte(2),
            Shape::Group(fields) => self.byte(3).fields(fields),
            Shape::Choice { tag, variants } => match tag {
                None => self.byte(4).variants(variants),
                Some(tag) => self.byte(5).text(tag).variants(variants),
            },
            Shape::Optional(inner) => self.byte(6).shape(inner),
            Shape::Array { item, length } => self.byte(7).number(*length as u64).shape(item),
            Shape::List {
                item,
                maximum_length,
            } => self.byte(8).number(*maximum_length as u64).shape(item),
            Shape::AtRunTime(_) => panic!("the compiler does not know this shape"),
        }
    }

    const fn fields(self, fields: &[Field]) -> Self {
        let mut hash = self.number(fields.len() as u64);
        let mut index = 0;
        while index < fields.len() {
            let field = &fields[index];
            hash = hash.text(field.key).text(field.unit).shape(&field.shape);
            hash = match field.range {
                None => hash.byte(0),
                Some(Range { minimum, maximum }) => hash
                    .byte(1)
                    .number(minimum.to_bits())
                    .number(maximum.to_bits()),
            };
            index += 1;
        }
        hash
    }

    const fn variants(self, variants: &[Variant]) -> Self {
        let mut hash = self.number(variants.len() as u64);
        let mut index = 0;
        while index < variants.len() {
            let variant = &variants[index];
            hash = hash.text(variant.key);
            hash = match &variant.content {
                None => hash.byte(0),
                Some(content) => hash.byte(1).shape(content),
            };
            index += 1;
        }
        hash
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings;
    use crate::settings::SettingValue;

    /// Declares the same settings as `original` with one difference, and hashes them.
    macro_rules! hash_of {
        ($($declaration:tt)*) => {{
            settings! { $($declaration)* }
            const HASH: u64 = SchemaHash(0).value("", &Changed::SHAPE).finish();
            HASH
        }};
    }

    fn original() -> u64 {
        hash_of! {
            /// Settings.
            pub struct Changed {
                /// Force.
                force_n: f32 = 1.0, 0.0..=10.0, "N";
                /// Torque.
                torque_nm: f32 = 1.0, 0.0..=10.0, "N·m";
                /// Attempts.
                attempts: u8 = 3, 0..=5;
            }
        }
    }

    #[test]
    fn comments_and_defaults_change_nothing() {
        let same = hash_of! {
            /// The same settings in other words.
            #[derive(Copy)]
            pub struct Changed {
                /// The force
                /// on the tip.
                force_n: f32 = 2.0, 0.0..=10.0, "N";
                // A note.
                /// Torque.
                torque_nm: f32 = 3.0, 0.0..=10.0, "N·m";
                /// Attempts.
                attempts: u8 = 1, 0..=5;
            }
        };
        assert_eq!(same, original());
    }

    #[test]
    fn names_units_ranges_types_and_order_change_it() {
        macro_rules! changed {
            ($($name:ident: $type:ty = $default:expr, $range:expr $(, $unit:literal)?;)*) => {
                hash_of! {
                    /// Settings.
                    pub struct Changed {
                        $(
                            /// A setting.
                            $name: $type = $default, $range $(, $unit)?;
                        )*
                    }
                }
            };
        }
        let unchanged = changed! {
            force_n: f32 = 1.0, 0.0..=10.0, "N"; torque_nm: f32 = 1.0, 0.0..=10.0, "N·m"; attempts: u8 = 3, 0..=5;
        };
        assert_eq!(unchanged, original());
        for (change, hash) in [
            (
                "name",
                changed! {
                    force: f32 = 1.0, 0.0..=10.0, "N"; torque_nm: f32 = 1.0, 0.0..=10.0, "N·m"; attempts: u8 = 3, 0..=5;
                },
            ),
            (
                "unit",
                changed! {
                    force_n: f32 = 1.0, 0.0..=10.0, "mN"; torque_nm: f32 = 1.0, 0.0..=10.0, "N·m"; attempts: u8 = 3, 0..=5;
                },
            ),
            (
                "minimum",
                changed! {
                    force_n: f32 = 1.0, 0.1..=10.0, "N"; torque_nm: f32 = 1.0, 0.0..=10.0, "N·m"; attempts: u8 = 3, 0..=5;
                },
            ),
            (
                "maximum",
                changed! {
                    force_n: f32 = 1.0, 0.0..=11.0, "N"; torque_nm: f32 = 1.0, 0.0..=10.0, "N·m"; attempts: u8 = 3, 0..=5;
                },
            ),
            (
                "type",
                changed! {
                    force_n: f32 = 1.0, 0.0..=10.0, "N"; torque_nm: f32 = 1.0, 0.0..=10.0, "N·m"; attempts: u16 = 3, 0..=5;
                },
            ),
            (
                "order",
                changed! {
                    torque_nm: f32 = 1.0, 0.0..=10.0, "N·m"; force_n: f32 = 1.0, 0.0..=10.0, "N"; attempts: u8 = 3, 0..=5;
                },
            ),
            (
                "number",
                changed! {
                    force_n: f32 = 1.0, 0.0..=10.0, "N"; torque_nm: f32 = 1.0, 0.0..=10.0, "N·m";
                },
            ),
        ] {
            assert_ne!(hash, original(), "{change}");
        }
    }

    #[test]
    fn so_do_the_variants_of_a_choice_and_the_lengths_of_lists() {
        settings! {
            /// One choice.
            pub enum One = Off {
                /// Off.
                "off" => Off,
                /// On.
                "on" => On,
            }
        }
        settings! {
            /// The same choice with its variants exchanged.
            pub enum Other = Off {
                /// On.
                "on" => On,
                /// Off.
                "off" => Off,
            }
        }
        let hash = |shape: &Shape| SchemaHash(0).value("", shape);
        assert_ne!(hash(&One::SHAPE), hash(&Other::SHAPE));
        assert_ne!(hash(&<[u8; 2]>::SHAPE), hash(&<[u8; 3]>::SHAPE));
        assert_ne!(hash(&Option::<u8>::SHAPE), hash(&u8::SHAPE));
        assert_ne!(hash(&f32::SHAPE), hash(&f64::SHAPE));
    }

    #[test]
    fn so_do_the_names_and_the_order_of_messages() {
        #[derive(Schema)]
        struct One {
            _ticks: u32,
            _lapses: u32,
        }
        #[derive(Schema)]
        struct Other {
            _lapses: u32,
            _ticks: u32,
        }
        assert_ne!(SchemaHash::of_type::<One>(), SchemaHash::of_type::<Other>());
    }
}

//! The macros that declare settings and check bounds between them, with what their expansions call.

use super::{Bounds, Range, Refused, SettingValue, Shape};
use crate::range::OutOfRange;

/// Declares a group of settings or a choice; see the [module](mod@crate::settings).
///
/// A group lists `name: type = default, range, "unit";` with a doc comment on every setting; range and
/// unit are optional where they do not apply. A choice lists `"name" => Variant`, which takes nothing, a
/// group's type in parentheses, or settings without defaults in braces. `enum Name = Variant` makes a
/// variant the default; `enum Name by "key"` stores the variant's name under a key beside its settings.
#[macro_export]
macro_rules! settings {
    (@range) => { ::core::option::Option::None };
    (@range $range:expr) => {{
        let range = $range;
        ::core::option::Option::Some($crate::settings::Range {
            minimum: *range.start() as f64,
            maximum: *range.end() as f64,
        })
    }};
    (@unit) => { "" };
    (@unit $unit:literal) => { $unit };
    (@tag) => { ::core::option::Option::None };
    (@tag $tag:literal) => { ::core::option::Option::Some($tag) };
    (@field $field:ident, $type:ty, [$($range:expr)?], [$($unit:literal)?], $($meaning:literal)+) => {
        $crate::settings::Field {
            key: stringify!($field),
            meaning: concat!($($meaning),+).trim_ascii(),
            unit: $crate::settings!(@unit $($unit)?),
            range: $crate::settings!(@range $($range)?),
            shape: <$type as $crate::settings::SettingValue>::SHAPE,
        }
    };
    (@check $value:expr, $error:ident, $field:ident, $type:ty, [$($range:expr)?]) => {
        $crate::settings::SettingValue::check(
            $value,
            const {
                &$crate::settings::Bounds::declared::<$type>(
                    stringify!($field),
                    $crate::settings!(@range $($range)?),
                )
            },
            $error,
        )?
    };
    (@complete) => { false };
    (@complete { $($field:ident)* }) => { true };
    (@content) => { ::core::option::Option::None };
    (@content ($content:ty)) => {
        ::core::option::Option::Some(<$content as $crate::settings::SettingValue>::SHAPE)
    };
    (@content { $($field:tt)* }) => {
        ::core::option::Option::Some($crate::settings::Shape::Group(&[$($field)*]))
    };

    (
        $(#[$attribute:meta])*
        $visibility:vis struct $name:ident
        $(<$($generic:ident: $bound:path $(= $preset:ty)?),+>)? {
            $(
                $(#[doc = $meaning:literal])+
                $field:ident: $type:ty = $default:expr $(, $range:expr $(, $unit:literal)?)?;
            )*
        }
        $(check $relations:expr;)?
    ) => {
        $(#[$attribute])*
        #[derive(
            Clone, Debug, PartialEq,
            $crate::settings::serde::Serialize, $crate::settings::serde::Deserialize,
        )]
        #[serde(crate = "painleve_shared::settings::serde", default, deny_unknown_fields)]
        $visibility struct $name $(<$($generic: $bound $(= $preset)?),+>)? {
            $(
                $(#[doc = $meaning])+
                #[doc = concat!(
                    "\n\nDefault: `", stringify!($default), "`",
                    $("; allowed: `", stringify!($range), "`", $(" ", $unit,)?)? "."
                )]
                pub $field: $type,
            )*
        }

        impl $(<$($generic: $bound),+>)? ::core::default::Default for $name $(<$($generic),+>)? {
            fn default() -> Self {
                Self { $($field: $default),* }
            }
        }

        impl $(<$($generic: $bound),+>)? $crate::settings::Settings for $name $(<$($generic),+>)? {
            const FIELDS: &'static [$crate::settings::Field] = &[
                $($crate::settings!(
                    @field $field, $type, [$($range)?], [$($($unit)?)?], $($meaning)+
                )),*
            ];
        }

        impl $(<$($generic: $bound),+>)? $crate::settings::SettingValue
            for $name $(<$($generic),+>)?
        {
            const SHAPE: $crate::settings::Shape =
                $crate::settings::Shape::Group(<Self as $crate::settings::Settings>::FIELDS);

            #[inline(never)]
            fn check(
                &self,
                bounds: &$crate::settings::Bounds,
                error: &mut $crate::range::OutOfRange,
            ) -> ::core::result::Result<(), $crate::settings::Refused> {
                type Checked = ::core::result::Result<(), $crate::settings::Refused>;
                let check = |error: &mut $crate::range::OutOfRange| -> Checked {
                    $($crate::settings!(@check &self.$field, error, $field, $type, [$($range)?]);)*
                    $(
                        if let ::core::result::Result::Err(relation) = $relations(self) {
                            *error = relation;
                            return ::core::result::Result::Err($crate::settings::Refused);
                        }
                    )?
                    ::core::result::Result::Ok(())
                };
                check(error).map_err(|_| $crate::settings::named(error, bounds.key))
            }
        }
    };

    (
        $(#[$attribute:meta])*
        $visibility:vis enum $name:ident $(= $default:ident)? $(by $tag:literal)? {
            $(
                $(#[doc = $meaning:literal])+
                $key:literal => $variant:ident
                $(($content:ty))?
                $({
                    $(
                        $(#[doc = $field_meaning:literal])+
                        $field:ident: $type:ty $(, $range:expr $(, $unit:literal)?)?;
                    )*
                })?
            ),* $(,)?
        }
    ) => {
        $(#[$attribute])*
        #[derive(
            Clone, Debug, PartialEq,
            $crate::settings::serde::Serialize, $crate::settings::serde::Deserialize,
        )]
        #[serde(
            crate = "painleve_shared::settings::serde",
            deny_unknown_fields $(, tag = $tag)?
        )]
        $visibility enum $name {
            $(
                $(#[doc = $meaning])+
                #[serde(rename = $key)]
                $variant
                $(($content))?
                $({
                    $(
                        $(#[doc = $field_meaning])+
                        #[doc = concat!(
                            "\n\n", $("Allowed: `", stringify!($range), "`", $(" ", $unit,)? ".")?
                        )]
                        $field: $type,
                    )*
                })?
            ),*
        }

        $(
            impl ::core::default::Default for $name {
                fn default() -> Self {
                    Self::$default
                }
            }
        )?

        impl $name {
            /// Returns the variant's name in files.
            #[allow(dead_code)]
            pub const fn name(&self) -> &'static str {
                match self {
                    $(Self::$variant { .. } => $key),*
                }
            }
        }

        impl $crate::settings::SettingValue for $name {
            const SHAPE: $crate::settings::Shape = $crate::settings::Shape::Choice {
                tag: $crate::settings!(@tag $($tag)?),
                variants: &[$(
                    $crate::settings::Variant {
                        key: $key,
                        meaning: concat!($($meaning),+).trim_ascii(),
                        complete: $crate::settings!(@complete $({ $($field)* })?),
                        content: $crate::settings!(@content
                            $(($content))?
                            $({$(
                                $crate::settings!(
                                    @field $field, $type, [$($range)?], [$($($unit)?)?],
                                    $($field_meaning)+
                                ),
                            )*})?
                        ),
                    }
                ),*],
            };

            // A choice without settings has nothing to check.
            #[allow(unused_variables)]
            #[inline(never)]
            fn check(
                &self,
                bounds: &$crate::settings::Bounds,
                error: &mut $crate::range::OutOfRange,
            ) -> ::core::result::Result<(), $crate::settings::Refused> {
                $(
                    $(
                        if let Self::$variant(content) = self {
                            return <$content as $crate::settings::SettingValue>::check(
                                content,
                                const { &$crate::settings::Bounds::declared::<$content>(
                                    $key, ::core::option::Option::None,
                                ) },
                                error,
                            )
                            .map_err(|_| $crate::settings::named(error, bounds.key));
                        }
                    )?
                    $(
                        if let Self::$variant { $($field),* } = self {
                            type Checked = ::core::result::Result<(), $crate::settings::Refused>;
                            // A variant with empty braces has nothing to check.
                            #[allow(unused_variables)]
                            let check = |error: &mut $crate::range::OutOfRange| -> Checked {
                                $($crate::settings!(
                                    @check $field, error, $field, $type, [$($range)?]
                                );)*
                                ::core::result::Result::Ok(())
                            };
                            return check(error).map_err(|_| {
                                $crate::settings::in_variant(
                                    error,
                                    &<Self as $crate::settings::SettingValue>::SHAPE,
                                    $key,
                                );
                                $crate::settings::named(error, bounds.key)
                            });
                        }
                    )?
                )*
                ::core::result::Result::Ok(())
            }
        }
    };
}

/// Adds a variant's name to the key of an error, unless the name is itself a value beside the settings.
#[doc(hidden)]
#[cold]
pub fn in_variant(error: &mut OutOfRange, choice: &Shape, key: &'static str) {
    if !matches!(choice, Shape::Choice { tag: Some(_), .. }) {
        error.enclose(key);
    }
}

/// Checks a setting against bounds that depend on other settings, as in
/// `check_setting!(self.estimator.bandwidth_rad_s, 1.0, 3.0 * tick_hz)`. The key in the error is the
/// setting's path relative to `self`; a setting that does not exist does not compile.
#[macro_export]
macro_rules! check_setting {
    ($group:ident $(.$part:ident)+, $minimum:expr, $maximum:expr) => {
        $crate::settings::check_named(
            &$group $(.$part)+,
            f64::from($minimum),
            f64::from($maximum),
            &[$(stringify!($part)),+],
        )
    };
}

/// Checks a value against bounds; `names` are the names of its groups, outermost first, and its own.
///
/// # Errors
/// [`OutOfRange`] with the value's full key.
#[doc(hidden)]
#[inline(never)]
pub fn check_named<T: SettingValue>(
    value: &T,
    minimum: f64,
    maximum: f64,
    names: &[&'static str],
) -> Result<(), OutOfRange> {
    let mut error = OutOfRange::default();
    let bounds = Bounds {
        key: "",
        range: Some(Range { minimum, maximum }),
    };
    value.check(&bounds, &mut error).map_err(|Refused| {
        for name in names.iter().rev() {
            error.enclose(name);
        }
        error
    })
}

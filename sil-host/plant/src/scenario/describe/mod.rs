//! Descriptions of all settings, generated from their declarations.
//!
//! - [`Scenario::to_commented_toml`]: a scenario with every key, its meaning, unit and range
//! - [`Scenario::to_brief_toml`]: a scenario without what has its default
//! - [`Scenario::differences`]: the keys in which two scenarios differ
//! - [`json_schema`]: the same for editors
//! - [`settings`]: a list of all keys

mod commented;
mod difference;
mod list;
mod schema;

use std::f64::consts::PI;

use painleve_shared::settings::{Field, Range, Settings, Shape};
use serde::ser::Error;
use toml::{Table, Value};

use super::Scenario;

pub use difference::Difference;
pub use list::{Setting, settings};
pub use schema::json_schema;

impl Scenario {
    /// Returns every key of the scenario as TOML. Not generic: serialising a scenario takes long to compile.
    ///
    /// # Errors
    /// For a seed of 2^63 or more, which TOML cannot write.
    pub fn to_toml(&self) -> Result<String, toml::ser::Error> {
        toml::to_string(self as &dyn erased_serde::Serialize)
    }

    /// Returns every key of the scenario that is not absent as JSON.
    ///
    /// # Errors
    /// As [`Self::to_toml`].
    pub fn to_json(&self) -> serde_json::Result<serde_json::Value> {
        let table = self.to_table().map_err(serde_json::Error::custom)?;
        serde_json::to_value(table)
    }

    /// Returns every key of the scenario as a TOML table; single-precision values keep the digits with which they were
    /// written.
    ///
    /// # Errors
    /// As [`Self::to_toml`].
    pub(super) fn to_table(&self) -> Result<Table, toml::ser::Error> {
        self.to_toml()?.parse().map_err(toml::ser::Error::custom)
    }
}

/// Returns a scenario as a TOML table; empty if it cannot be written.
fn table(scenario: &Scenario) -> Table {
    scenario.to_table().unwrap_or_default()
}

/// Returns a setting with the kind of value that this program knows for it.
fn resolved(field: &Field) -> Field {
    Field {
        shape: field.shape.resolved(),
        ..*field
    }
}

/// Returns the allowed values of a setting in words; empty if its type says everything.
fn allowed(field: &Field) -> String {
    let mut text = match field.range {
        Some(range) => interval(&range),
        None => names(&field.shape).unwrap_or_default(),
    };
    match field.shape {
        Shape::Array { .. } => text = format!("each {text}"),
        Shape::List { maximum_length, .. } => text = format!("up to {maximum_length} of {text}"),
        _ => {}
    }
    if !field.unit.is_empty() {
        text = format!("{text} {}", field.unit);
    }
    if matches!(field.shape, Shape::Optional(_)) {
        text = format!("{text}, or absent");
    }
    text.trim_start_matches(", ").into()
}

pub(super) fn interval(range: &Range) -> String {
    format!("{} to {}", bound(range.minimum), bound(range.maximum))
}

fn bound(value: f64) -> String {
    let size = value.abs();
    if size == PI {
        value.to_string().replace("3.141592653589793", "π")
    } else if size != 0.0 && !(1e-3..1e6).contains(&size) {
        format!("{value:e}")
    } else {
        value.to_string()
    }
}

/// Returns the names of a choice's variants, or of a switch's positions.
fn names(shape: &Shape) -> Option<String> {
    match shape {
        Shape::Switch => Some("true or false".into()),
        Shape::Choice { variants, .. } => {
            let names: Vec<_> = variants.iter().map(|it| it.key).collect();
            let (last, others) = names.split_last()?;
            Some(format!("{} or {last}", others.join(", ")))
        }
        Shape::Optional(item) | Shape::Array { item, .. } | Shape::List { item, .. } => names(item),
        _ => None,
    }
}

/// Returns the settings of a group, or of the group in an optional value.
fn group(shape: &Shape) -> Option<&'static [Field]> {
    match shape {
        Shape::Group(fields) => Some(fields),
        Shape::Optional(inner) => group(inner),
        _ => None,
    }
}

/// Whether the setting at `path` may be absent.
pub(super) fn is_optional(path: &[&str]) -> bool {
    shapes(path)
        .iter()
        .any(|shape| matches!(shape, Shape::Optional(_)))
}

/// Returns the keys of the group at `path`, with those that may be absent from its `table`.
pub(super) fn keys(path: &[&str], table: &Table) -> Vec<String> {
    match shapes(path).first().and_then(group) {
        Some(fields) => fields.iter().map(|field| field.key.into()).collect(),
        None => table.keys().cloned().collect(),
    }
}

/// Returns the names of the variants of the choice at `path` whose settings are in a table under the
/// variant's name; none if `path` is something else.
pub(super) fn untagged_variants(path: &[&str]) -> Vec<&'static str> {
    let choices = shapes(path).into_iter();
    choices
        .flat_map(|shape| match shape.resolved() {
            Shape::Choice {
                tag: None,
                variants,
            } if variants.iter().any(|one| one.content.is_some()) => variants,
            _ => &[],
        })
        .map(|variant| variant.key)
        .collect()
}

/// Returns the value of the setting at `path` if its text is the name of a variant that is a table: that variant with the
/// defaults of its settings. Any other text is the value itself.
pub(super) fn chosen(path: &[&str], text: String) -> Value {
    for shape in shapes(path) {
        let Shape::Choice { tag, variants } = shape.resolved() else {
            continue;
        };
        let Some(variant) = variants.iter().find(|variant| variant.key == text) else {
            continue;
        };
        let table = match tag {
            Some(tag) => Table::from_iter([(tag.into(), Value::String(text))]),
            None if variant.content.is_none() => continue,
            None => Table::from_iter([(text, Value::Table(Table::new()))]),
        };
        return Value::Table(table);
    }
    Value::String(text)
}

/// Returns the path of the choice whose tag is the setting at `path`: naming a kind chooses all of it.
pub(super) fn choice_of_tag<'a>(path: &'a [&'a str]) -> Option<&'a [&'a str]> {
    let (last, choice) = path.split_last()?;
    let is_tag = |shape: &Shape| matches!(shape.resolved(), Shape::Choice { tag: Some(tag), .. } if tag == *last);
    shapes(choice).iter().any(is_tag).then_some(choice)
}

/// Returns the setting at `path`, which may be an item of one, unless several variants of a choice have one there.
pub(super) fn setting(path: &[&str]) -> Option<Field> {
    let [setting] = fields(path).try_into().ok()?;
    let shape = match setting.shape.resolved() {
        Shape::Optional(inner) => *inner,
        known => known,
    };
    Some(Field { shape, ..setting })
}

/// Returns the kinds that the value at `path` may have.
fn shapes(path: &[&str]) -> Vec<Shape> {
    fields(path).iter().map(|field| field.shape).collect()
}

/// Returns the settings that the value at `path` may be, with the kind of that value.
fn fields(path: &[&str]) -> Vec<Field> {
    let root = Field {
        key: "",
        meaning: "",
        unit: "",
        range: None,
        shape: Shape::Group(Scenario::FIELDS),
    };
    path.iter().fold(vec![root], |fields, part| {
        let parts = fields.into_iter().flat_map(|field| inside(field, part));
        parts.collect()
    })
}

/// Returns what a value's part may be: several if variants of a choice share its name.
fn inside(field: Field, part: &str) -> Vec<Field> {
    let with = |shape| Field { shape, ..field };
    match field.shape.resolved() {
        Shape::Group(fields) => {
            let named = fields.iter().filter(|field| field.key == part);
            named.copied().collect()
        }
        Shape::Optional(inner) => inside(with(*inner), part),
        Shape::Array { item, .. } | Shape::List { item, .. } => {
            let is_index = part.parse::<usize>().is_ok();
            is_index.then_some(with(*item)).into_iter().collect()
        }
        Shape::Choice {
            tag: None,
            variants,
        } => {
            let named = variants.iter().filter(|variant| variant.key == part);
            named
                .filter_map(|variant| variant.content.map(with))
                .collect()
        }
        // The settings of a tagged variant are beside its name.
        Shape::Choice { tag: Some(tag), .. } if tag == part => vec![with(Shape::Text)],
        Shape::Choice { variants, .. } => {
            let contents = variants.iter().filter_map(|variant| variant.content);
            contents
                .flat_map(|content| inside(with(content), part))
                .collect()
        }
        Shape::Switch
        | Shape::Integer(_)
        | Shape::Number(_)
        | Shape::Text
        | Shape::AtRunTime(_) => Vec::new(),
    }
}

/// Returns the default value at `path`; variant names in the path select the variant.
fn default_at(path: &[&str]) -> Option<Value> {
    let chosen = path.iter().rev().skip(1).fold(Table::new(), |inner, key| {
        Table::from_iter([((*key).to_string(), Value::Table(inner))])
    });
    let scenario = Scenario::from_keys(chosen).unwrap_or_default();
    path.iter()
        .try_fold(Value::Table(table(&scenario)), |value, key| {
            value.get(key).cloned()
        })
}

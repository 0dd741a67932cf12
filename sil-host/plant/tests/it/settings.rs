//! Sets every setting of a scenario out of its range: the message must name its key, value and
//! range.

use painleve_plant::scenario::Scenario;
use painleve_shared::range::Shortest;
use painleve_shared::settings::{Field, Range, Settings, Shape, Variant};
use toml::{Table, Value};

/// An out-of-range number of the plant, and its key.
struct Wrong {
    key: String,
    value: f64,
    range: Range,
    file: Value,
}

/// Returns a table with one entry.
fn entry(key: &str, value: Value) -> Value {
    Value::Table(Table::from_iter([(key.to_string(), value)]))
}

/// Returns a value within range.
fn right(shape: &Shape, range: Option<Range>) -> Value {
    match shape {
        Shape::Switch => Value::Boolean(true),
        Shape::Text => Value::String("text".into()),
        Shape::Integer(_) => Value::Integer(range.map_or(1, |range| range.minimum as i64)),
        Shape::Number(_) => Value::Float(range.map_or(1.0, |range| range.minimum)),
        Shape::Optional(inner) => right(inner, range),
        Shape::Array { item, length } => Value::Array(vec![right(item, range); *length]),
        Shape::Group(_) | Shape::List { .. } | Shape::Choice { .. } | Shape::AtRunTime(_) => {
            unreachable!("{shape:?}")
        }
    }
}

/// Collects every wrong value of `shape` at `key`; `inside` turns each into a file.
fn wrong(
    key: &str,
    shape: &Shape,
    range: Option<Range>,
    inside: &dyn Fn(Value) -> Value,
) -> Vec<Wrong> {
    match shape {
        Shape::Switch | Shape::Text => Vec::new(),
        Shape::Integer(_) | Shape::Number(_) => {
            let whole = matches!(shape, Shape::Integer(_));
            let Some(range) = range else {
                assert!(whole, "{key} has no range");
                return Vec::new();
            };
            // Exact in single precision, since the setting may be single-precision.
            let above = f64::from((range.maximum + range.maximum.abs().max(1.0)) as f32);
            let below = f64::from((range.minimum - range.minimum.abs().max(1.0)) as f32);
            let mut values = vec![above];
            if whole {
                // An unsigned type rejects negative values itself.
                values.extend((below >= 0.0).then_some(below));
            } else {
                values.extend([below, f64::INFINITY, f64::NAN]);
            }
            let wrong = |value| Wrong {
                key: key.into(),
                value,
                range,
                file: inside(if whole {
                    Value::Integer(value as i64)
                } else {
                    Value::Float(value)
                }),
            };
            values.into_iter().map(wrong).collect()
        }
        Shape::AtRunTime(_) => wrong(key, &shape.resolved(), range, inside),
        Shape::Group(fields) => in_fields(key, fields, &[], inside),
        Shape::Optional(inner) => wrong(key, inner, range, inside),
        Shape::Array { item, length } => (0..*length)
            .flat_map(|index| {
                let inside = |value| {
                    let mut values = vec![right(item, range); *length];
                    values[index] = value;
                    inside(Value::Array(values))
                };
                wrong(&format!("{key}.{index}"), item, range, &inside)
            })
            .collect(),
        Shape::List { item, .. } => {
            let inside = |value| inside(Value::Array(vec![value]));
            wrong(&format!("{key}.0"), item, range, &inside)
        }
        Shape::Choice { tag, variants } => variants
            .iter()
            .flat_map(|variant| in_variant(key, variant, *tag, inside))
            .collect(),
    }
}

fn in_variant(
    key: &str,
    variant: &Variant,
    tag: Option<&str>,
    inside: &dyn Fn(Value) -> Value,
) -> Vec<Wrong> {
    let Some(Shape::Group(fields)) = variant.content else {
        return Vec::new();
    };
    let mut others: Vec<_> = fields.iter().filter(|_| variant.complete).collect();
    others.retain(|field| !matches!(field.shape, Shape::Group(_)));
    match tag {
        Some(tag) => in_fields(key, fields, &others, &|mut value| {
            if let Value::Table(table) = &mut value {
                table.insert(tag.into(), Value::String(variant.key.into()));
            }
            inside(value)
        }),
        None => in_fields(
            &format!("{key}.{}", variant.key),
            fields,
            &others,
            &|value| inside(entry(variant.key, value)),
        ),
    }
}

/// Collects wrong values of every field, with valid values of `others`.
fn in_fields(
    key: &str,
    fields: &[Field],
    others: &[&Field],
    inside: &dyn Fn(Value) -> Value,
) -> Vec<Wrong> {
    let prefix = if key.is_empty() {
        String::new()
    } else {
        format!("{key}.")
    };
    fields
        .iter()
        .flat_map(|field| {
            let inside = |value| {
                let mut table = Table::new();
                for other in others {
                    table.insert(other.key.into(), right(&other.shape, other.range));
                }
                table.insert(field.key.into(), value);
                inside(Value::Table(table))
            };
            wrong(
                &format!("{prefix}{}", field.key),
                &field.shape,
                field.range,
                &inside,
            )
        })
        .collect()
}

#[test]
fn every_setting_out_of_range_is_named_with_its_value_and_range() {
    let all = in_fields("", Scenario::FIELDS, &[], &|file| file);
    assert!(all.len() > 300, "only {}", all.len());
    for wrong in all {
        let text = toml::to_string(&wrong.file).unwrap();
        let scenario: Scenario =
            toml::from_str(&text).unwrap_or_else(|error| panic!("{}: {error}\n{text}", wrong.key));
        let error = scenario.validate().expect_err(&wrong.key).to_string();
        let expected = format!(
            "{} = {} is outside the allowed range {} to {}",
            wrong.key,
            Shortest(wrong.value),
            Shortest(wrong.range.minimum),
            Shortest(wrong.range.maximum),
        );
        assert_eq!(error, expected);
    }
}

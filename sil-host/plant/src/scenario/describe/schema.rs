//! JSON Schema of scenarios, with which editors complete and check TOML files.

use painleve_shared::settings::{Field, Range, Settings, Shape, Variant};
use serde_json::{Map, Value, json};

use super::{allowed, resolved, table};
use crate::scenario::Scenario;

/// Returns the JSON Schema (draft 2020-12) of a scenario file. Ranges that depend on other settings
/// appear only in the descriptions.
pub fn json_schema() -> Value {
    let defaults = serde_json::to_value(table(&Scenario::default())).unwrap_or_default();
    let mut schema = object(Scenario::FIELDS, &defaults, &[]);
    schema["$schema"] = json!("https://json-schema.org/draft/2020-12/schema");
    schema["title"] = json!("painleve scenario");
    schema
}

/// Returns the schema of a table of settings, including the `required` ones.
fn object(fields: &[Field], defaults: &Value, required: &[&str]) -> Value {
    let properties: Map<_, _> = fields
        .iter()
        .map(|field| (field.key.into(), property(field, &defaults[field.key])))
        .collect();
    json!({
        "type": "object",
        "additionalProperties": false,
        "required": required,
        "properties": properties,
    })
}

fn property(field: &Field, default: &Value) -> Value {
    let field = &resolved(field);
    let mut schema = value(&field.shape, field.range, default);
    let allowed = allowed(field);
    schema["description"] = if allowed.is_empty() {
        json!(field.meaning)
    } else {
        json!(format!("{} ({allowed})", field.meaning))
    };
    if !default.is_null() && !matches!(field.shape, Shape::Group(_)) {
        schema["default"] = default.clone();
    }
    schema
}

fn value(shape: &Shape, range: Option<Range>, default: &Value) -> Value {
    match shape {
        Shape::Switch => json!({ "type": "boolean" }),
        Shape::Text => json!({ "type": "string" }),
        Shape::Integer(_) => match range {
            Some(range) => json!({
                "type": "integer", "minimum": range.minimum, "maximum": range.maximum,
            }),
            None => json!({ "type": "integer", "minimum": 0 }),
        },
        Shape::Number(_) => match range {
            Some(range) => json!({
                "type": "number", "minimum": range.minimum, "maximum": range.maximum,
            }),
            None => json!({ "type": "number" }),
        },
        Shape::AtRunTime(_) => value(&shape.resolved(), range, default),
        Shape::Group(fields) => object(fields, default, &[]),
        Shape::Optional(inner) => value(inner, range, default),
        Shape::Array { item, length } => json!({
            "type": "array", "items": value(item, range, &Value::Null),
            "minItems": length, "maxItems": length,
        }),
        Shape::List {
            item,
            maximum_length,
        } => json!({
            "type": "array", "items": value(item, range, &Value::Null),
            "maxItems": maximum_length,
        }),
        Shape::Choice { tag, variants } => {
            let variants = variants.iter().map(|variant| one_variant(variant, *tag));
            json!({ "oneOf": variants.collect::<Vec<_>>() })
        }
    }
}

fn one_variant(variant: &Variant, tag: Option<&str>) -> Value {
    let key = variant.key;
    let fields: &[Field] = match variant.content {
        Some(Shape::Group(fields)) => fields,
        _ => &[],
    };
    let mut required: Vec<&str> = Vec::new();
    if variant.complete {
        required.extend(fields.iter().map(|field| field.key));
    }
    let mut schema = match (tag, &variant.content) {
        (Some(tag), _) => {
            required.push(tag);
            let mut schema = object(fields, &Value::Null, &required);
            schema["properties"][tag] = json!({ "const": key });
            schema
        }
        (None, None) => json!({ "const": key }),
        (None, Some(_)) => json!({
            "type": "object",
            "additionalProperties": false,
            "required": [key],
            "properties": { key: object(fields, &Value::Null, &required) },
        }),
    };
    schema["description"] = json!(variant.meaning);
    schema
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::built_in;
    use boon::{Compiler, Schemas};

    const NAME: &str = "scenario.json";

    /// Validates the text of a scenario file.
    fn validate(text: &str) -> Result<(), String> {
        let (mut schemas, mut compiler) = (Schemas::new(), Compiler::new());
        compiler.add_resource(NAME, json_schema()).unwrap();
        let schema = compiler.compile(NAME, &mut schemas).unwrap();
        let file: toml::Table = toml::from_str(text).unwrap();
        let file = serde_json::to_value(file).unwrap();
        let result = schemas.validate(&file, schema);
        result.map_err(|error| error.to_string())
    }

    #[test]
    fn built_in_scenarios_are_valid_as_written_and_with_every_key() {
        for name in built_in::names() {
            assert_eq!(validate(built_in::text(name).unwrap()), Ok(()), "{name}");
            let scenario = Scenario::load(name, &[]).unwrap();
            assert_eq!(validate(&scenario.to_commented_toml()), Ok(()), "{name}");
        }
        assert_eq!(
            validate("[controller.law.pid]\nproportional_nm_rad = [1.0, 0.0]"),
            Ok(())
        );
        assert_eq!(validate("[arm_model]\nheight_m = 0.37"), Ok(()));
    }

    #[test]
    fn mistakes_are_rejected() {
        for text in [
            "[belt]\nfrction = 0.6",
            "[belt]\nfriction = -1",
            "[belt]\nfriction = \"high\"",
            "[belt]\nprofile = { kind = \"ramp\", from_m_s = 0.1 }",
            "[belt]\nprofile = { kind = \"steady\", speed_m_s = 0.1 }",
            "[impact]\nlaw = \"newton\"",
            "[run]\ntick_hz = 0.5",
            "[arm]\nlink_length_m = [0.2]",
            "[controller]\nlaw = \"pid\"",
            "[controller]\nreference = [{ jump = { target_m = 0.1 } }]",
            "[controller.law.hybrid]\nfriction = { observed = {} }",
        ] {
            assert!(validate(text).is_err(), "{text}");
        }
    }

    #[test]
    fn defaults_and_meanings_are_in_the_schema() {
        let schema = json_schema();
        let contact = &schema["properties"]["controller"]["properties"]["contact"];
        let force = &contact["properties"]["contact_n"];
        assert_eq!(force["default"], 0.35);
        let description = force["description"].as_str().unwrap();
        assert!(description.starts_with("Smallest normal force of a contact"));
    }
}

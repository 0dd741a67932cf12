//! Parameters of a live run: every key of its scenario, and how simulated time passes.

use painleve_plant::scenario::Scenario;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::request::ViewerRequest;

/// Whether simulated time stands still.
const PAUSED: &str = "live.paused";
/// Simulated seconds per second; 0 for as fast as possible.
const SPEED: &str = "live.speed";

/// A parameter in Foxglove's protocol.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Parameter {
    /// Its name: a key of the scenario, or one of `live`.
    pub name: String,
    /// Its value.
    #[serde(default)]
    pub value: Value,
    /// Type of a number that JSON may write without a decimal point.
    #[serde(rename = "type", skip_serializing_if = "Option::is_none")]
    kind: Option<Kind>,
}

/// A type that the value alone does not show.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Kind {
    ByteArray,
    Float64,
    Float64Array,
}

impl Parameter {
    fn new(name: impl Into<String>, value: Value) -> Self {
        let is_float = |value: &Value| value.is_f64();
        let kind = match &value {
            Value::Array(list) if !list.is_empty() && list.iter().all(is_float) => {
                Some(Kind::Float64Array)
            }
            value => is_float(value).then_some(Kind::Float64),
        };
        Self {
            name: name.into(),
            value,
            kind,
        }
    }

    /// Returns the request that sets the parameter.
    ///
    /// # Errors
    /// A sentence for the user if its value cannot be one of this parameter.
    pub(crate) fn request(self) -> Result<ViewerRequest, String> {
        let Self { name, value, .. } = self;
        match (name.as_str(), value) {
            (PAUSED, Value::Bool(true)) => Ok(ViewerRequest::Pause),
            (PAUSED, Value::Bool(false)) => Ok(ViewerRequest::Resume),
            (PAUSED, _) => Err(format!("{PAUSED}: expected true or false")),
            (SPEED, value) => {
                let factor = value.as_f64();
                let factor = factor.ok_or_else(|| format!("{SPEED}: expected a number"))?;
                Ok(ViewerRequest::Speed { factor })
            }
            (_, value) => {
                let value = toml(&value).ok_or_else(|| format!("{name}: a value is missing"))?;
                Ok(ViewerRequest::Set { key: name, value })
            }
        }
    }
}

/// Writes a JSON value in TOML, on one line; `None` if it contains null.
fn toml(value: &Value) -> Option<String> {
    let all = |parts: &mut dyn Iterator<Item = Option<String>>| {
        let parts: Option<Vec<String>> = parts.collect();
        parts.map(|parts| parts.join(", "))
    };
    match value {
        Value::Null => None,
        // Numbers and texts of JSON are also those of TOML.
        Value::Bool(_) | Value::Number(_) | Value::String(_) => Some(value.to_string()),
        Value::Array(items) => all(&mut items.iter().map(toml)).map(|items| format!("[{items}]")),
        Value::Object(parts) => {
            let pair = |(key, value): (&String, &Value)| {
                toml(value).map(|value| format!("{} = {value}", Value::from(key.as_str())))
            };
            all(&mut parts.iter().map(pair)).map(|parts| format!("{{ {parts} }}"))
        }
    }
}

/// Returns the parameters of a run.
pub fn parameters(scenario: &Scenario, paused: bool, speed: f64) -> Vec<Parameter> {
    let mut found = vec![
        Parameter::new(PAUSED, paused.into()),
        Parameter::new(SPEED, speed.into()),
    ];
    // A scenario that has been loaded can be written.
    if let Ok(Value::Object(keys)) = scenario.to_json() {
        for (key, value) in keys {
            add_keys(key, value, &mut found);
        }
    }
    found
}

/// Adds the keys of a value, down to numbers, texts and lists of them.
fn add_keys(key: String, value: Value, found: &mut Vec<Parameter>) {
    match value {
        Value::Object(parts) => {
            for (part, value) in parts {
                add_keys(format!("{key}.{part}"), value, found);
            }
        }
        Value::Array(items) if items.iter().any(Value::is_object) => {
            for (index, value) in items.into_iter().enumerate() {
                add_keys(format!("{key}.{index}"), value, found);
            }
        }
        Value::Null => {}
        value => found.push(Parameter::new(key, value)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn every_parameter_can_be_set_to_its_value() {
        for name in ["hybrid-elbow-down", "pid-elbow-up", "edge"] {
            let scenario = Scenario::load(name, &[]).unwrap();
            for parameter in parameters(&scenario, false, 1.0).into_iter().skip(2) {
                let described = format!("{parameter:?}");
                let Ok(ViewerRequest::Set { key, value }) = parameter.request() else {
                    panic!("{described}");
                };
                let set = scenario
                    .clone()
                    .with_overrides(name, &[format!("{key}={value}")]);
                assert_eq!(set.unwrap(), scenario, "{described}");
            }
        }
    }

    #[test]
    fn numbers_have_types_and_lists_of_tables_are_numbered() {
        let scenario = Scenario::default();
        let parameters = parameters(&scenario, true, 0.0);
        let json = serde_json::to_value(&parameters).unwrap();
        let find = |name: &str| {
            let list = json.as_array().unwrap();
            list.iter().find(|one| one["name"] == name).unwrap().clone()
        };
        assert_eq!(
            find("live.paused"),
            json!({ "name": "live.paused", "value": true })
        );
        assert_eq!(
            find("belt.friction"),
            json!({ "name": "belt.friction", "type": "float64", "value": scenario.belt.friction })
        );
        assert_eq!(find("arm.link_length_m")["type"], "float64_array");
        assert_eq!(
            find("controller.reference.0.minimum-jerk.target_m")["type"],
            "float64"
        );
    }

    #[test]
    fn values_are_written_in_toml() {
        let value = json!({ "kind": "a \"b\"\n", "list": [1, 2.5, true] });
        let text = toml(&value).unwrap();
        let table: toml::Table = format!("value = {text}").parse().unwrap();
        assert_eq!(table["value"]["kind"].as_str(), Some("a \"b\"\n"));
        assert_eq!(table["value"]["list"][1].as_float(), Some(2.5));
    }

    #[test]
    fn values_of_the_wrong_type_are_refused() {
        for (name, value) in [
            ("live.paused", json!(1)),
            ("live.speed", json!("fast")),
            ("belt.friction", Value::Null),
        ] {
            let error = Parameter::new(name, value).request().unwrap_err();
            assert!(error.starts_with(name), "{error}");
        }
    }
}

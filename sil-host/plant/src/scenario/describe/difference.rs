//! What distinguishes a scenario from the defaults or from another scenario.

use painleve_shared::settings::Shape;
use serde::Serialize;
use toml::{Table, Value};

use super::{default_at, shapes, table};
use crate::scenario::Scenario;

/// A key whose values differ between two scenarios.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Difference {
    /// The key, as in `belt.friction`.
    pub key: String,
    /// Its value in the first scenario, in TOML; `None` if it is absent.
    pub first: Option<String>,
    /// Its value in the second scenario.
    pub second: Option<String>,
}

impl Difference {
    /// Returns key and both values as a table shows them.
    pub fn cells(&self) -> [&str; 3] {
        let [first, second] =
            [&self.first, &self.second].map(|value| value.as_deref().unwrap_or("absent"));
        [&self.key, first, second]
    }
}

impl Scenario {
    /// Returns the scenario as TOML without the keys that have their defaults. Reading the text gives the same
    /// scenario.
    pub fn to_brief_toml(&self) -> String {
        let mut path = Vec::new();
        let brief = table(self).into_iter().filter_map(|(key, value)| {
            let value = brief(&mut path, &key, value)?;
            Some((key, value))
        });
        toml::to_string(&Table::from_iter(brief)).unwrap_or_default()
    }

    /// Returns the keys in which another scenario differs from this one, in alphabetical order. A choice whose
    /// variants differ is one key, as are a list and a value that requires all its keys.
    pub fn differences(&self, other: &Self) -> Vec<Difference> {
        let mut found = Vec::new();
        collect(&mut Vec::new(), &table(self), &table(other), &mut found);
        found
    }
}

/// How a value at a path is written.
enum Form {
    /// A group: each key on its own.
    Keys,
    /// A choice whose variant's name is a key, with defaults inside.
    Variant,
    /// All or nothing.
    Whole,
}

fn form(path: &[String]) -> Form {
    let parts: Vec<&str> = path.iter().map(String::as_str).collect();
    match shapes(&parts).first().map(|shape| shape.resolved()) {
        Some(Shape::Choice {
            tag: None,
            variants,
        }) if !variants.iter().any(|variant| variant.complete) => Form::Variant,
        Some(Shape::Choice { .. }) => Form::Whole,
        _ => Form::Keys,
    }
}

/// Returns what of a value under `key` differs from its default; `None` if nothing does.
fn brief(path: &mut Vec<String>, key: &str, value: Value) -> Option<Value> {
    path.push(key.into());
    let parts: Vec<&str> = path.iter().map(String::as_str).collect();
    let default = default_at(&parts);
    let same = default.as_ref() == Some(&value);
    // A table that is absent by default is there even if all its keys have their defaults.
    let is_absent = default.is_none();
    let brief = match (value, form(path)) {
        _ if same => None,
        (Value::Table(values), Form::Keys) => {
            let inner: Table = inside(path, values);
            (is_absent || !inner.is_empty()).then_some(Value::Table(inner))
        }
        (Value::Table(values), Form::Variant) => Some(Value::Table(variant(path, values))),
        (value, _) => Some(value),
    };
    path.pop();
    brief
}

fn inside(path: &mut Vec<String>, values: Table) -> Table {
    let differing = values.into_iter().filter_map(|(key, value)| {
        let value = brief(path, &key, value)?;
        Some((key, value))
    });
    differing.collect()
}

/// Returns the settings of a variant that differ from its defaults, under the variant's name.
fn variant(path: &mut Vec<String>, choice: Table) -> Table {
    let with_name = choice.into_iter().map(|(name, content)| {
        path.push(name.clone());
        let content = match content {
            Value::Table(values) => Value::Table(inside(path, values)),
            other => other,
        };
        path.pop();
        (name, content)
    });
    with_name.collect()
}

fn collect(path: &mut Vec<String>, first: &Table, second: &Table, found: &mut Vec<Difference>) {
    let more = second.keys().filter(|key| !first.contains_key(*key));
    for key in first.keys().chain(more) {
        path.push(key.clone());
        match (first.get(key), second.get(key)) {
            (one, other) if one == other => {}
            (Some(Value::Table(one)), Some(Value::Table(other))) if can_enter(path, one, other) => {
                collect(path, one, other, found);
            }
            (one, other) => found.push(Difference {
                key: path.join("."),
                first: one.map(|value| text(path, value)),
                second: other.map(|value| text(path, value)),
            }),
        }
        path.pop();
    }
}

/// Whether the differences of two tables are those of their keys.
fn can_enter(path: &[String], one: &Table, other: &Table) -> bool {
    match form(path) {
        Form::Keys => true,
        Form::Variant => one.keys().eq(other.keys()),
        Form::Whole => false,
    }
}

/// Returns a value on one line, a variant without its defaults.
fn text(path: &mut Vec<String>, value: &Value) -> String {
    match (value, form(path)) {
        (Value::Table(choice), Form::Variant) => {
            Value::Table(variant(path, choice.clone())).to_string()
        }
        (value, _) => value.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::built_in;

    fn load(name: &str, overrides: &[&str]) -> Scenario {
        let overrides: Vec<_> = overrides.iter().map(ToString::to_string).collect();
        Scenario::load(name, &overrides).unwrap()
    }

    fn read_again(scenario: &Scenario) -> String {
        let text = scenario.to_brief_toml();
        let read = Scenario::from_toml(&text).unwrap_or_else(|error| panic!("{error}\n{text}"));
        assert_eq!(&read, scenario, "{text}");
        text
    }

    #[test]
    fn brief_scenarios_are_short_and_read_again() {
        for name in built_in::names() {
            let text = read_again(&load(name, &[]));
            let lines = text.lines().count();
            assert!(lines < 60, "{name}: {lines} lines\n{text}");
        }
        let edge = read_again(&load("edge", &["belt.friction=0.35"]));
        assert!(edge.contains("[belt]\nfriction = 0.35\n"), "{edge}");
        assert!(!edge.contains("tick_hz"), "{edge}");
    }

    #[test]
    fn choices_lists_and_optional_groups_read_again() {
        for overrides in [
            &["arm_model.height_m=0.36"][..],
            &["arm_model.height_m=0.3775"],
            &["controller.belt.given_m_s=-0.1", "controller.reference=[]"],
            &["controller.law=pid"],
            &["controller.law.hybrid.friction={observed={time_constant_s=0.01}}"],
            &["initial.tip_m=0.05", "initial.elbow=up"],
            &[
                "belt.profile={ kind = \"sine\", mean_m_s = -0.4, amplitude_m_s = 0.1, frequency_hz = 2.0 }",
            ],
            &[
                "contact.kind=compliant",
                "contact.normal={ restitution = { restitution = 0.5, mass_kg = 0.1 } }",
            ],
            &[
                "contact.kind=compliant",
                "effects.friction={ kind = \"step\", change = 0.1, at_s = 1.0 }",
            ],
        ] {
            read_again(&load("hybrid-elbow-down", overrides));
        }
    }

    #[test]
    fn differences_name_keys_and_both_values() {
        let edge = load("edge", &[]);
        assert_eq!(edge.differences(&edge), []);
        let other = load(
            "edge",
            &["belt.friction=0.35", "controller.belt.given_m_s=-0.4"],
        );
        let found = edge.differences(&other);
        let expected = [
            ("belt.friction", Some("0.6"), Some("0.35")),
            ("controller.belt.given_m_s", None, Some("-0.4")),
        ];
        let expected = expected.map(|(key, first, second)| Difference {
            key: key.into(),
            first: first.map(str::to_owned),
            second: second.map(str::to_owned),
        });
        assert_eq!(found, expected);
        let pid = edge.differences(&load("edge", &["controller.law=pid"]));
        let [law] = pid.as_slice() else {
            panic!("{pid:?}")
        };
        assert_eq!(law.key, "controller.law");
        assert_eq!(law.second.as_deref(), Some("{ pid = {} }"));
    }

    /// Setting the second value of each difference makes the first scenario the second.
    #[test]
    fn differences_can_be_set() {
        let [edge, capture, gains] = ["edge", "capture", "paper-gains"].map(|name| load(name, &[]));
        for (from, to) in [(&edge, &capture), (&edge, &gains), (&gains, &capture)] {
            let differences = from.differences(to);
            let set = differences
                .iter()
                .map(|one| format!("{}={}", one.key, one.second.as_ref().unwrap()));
            let set: Vec<String> = set.collect();
            let made = from.clone().with_overrides("test", &set).unwrap();
            assert_eq!(&made, to, "{set:?}");
        }
    }
}

//! Changes of single keys of a scenario: `key=value`, from the command line, a viewer, Python or a simulator.

use toml::{Table, Value};

use super::error::{KeyError, MOST_LEVELS, ScenarioError};
use super::table::from_table;
use super::{Scenario, describe, initial_key};

/// Returns the scenario with one key changed. The key must exist in the scenario or be optional,
/// such as `controller.belt.given_m_s`.
pub(super) fn with_override(mut scenario: Scenario, text: &str) -> Result<Scenario, ScenarioError> {
    let wrong = || ScenarioError::Override { text: text.into() };
    let (key, value) = text.split_once('=').ok_or_else(wrong)?;
    let (key, value) = (key.trim(), value.trim());
    // A line break would start another key, which would not be checked.
    if key.is_empty() || value.is_empty() || value.contains(['\n', '\r']) {
        return Err(wrong());
    }
    // Each level costs at least one recursive call in everything that visits the values.
    if key.split('.').count() > MOST_LEVELS {
        return Err(ScenarioError::TooDeep);
    }
    let value = parsed(value);
    let wrong_key = |source| ScenarioError::Key {
        origin: None,
        key: key.into(),
        source,
    };
    scenario.initial = initial_key::before_override(scenario.initial, key);
    let keys = scenario.to_table();
    let mut root = Value::Table(keys.map_err(|error| wrong_key(error.into()))?);
    // Message on the first part of the key that is missing, unless an optional setting is absent.
    let mut missing = None;
    let parts: Vec<&str> = key.split('.').collect();
    let present = parts.iter().try_fold(&root, |place, part| place.get(part));
    // Another kind has other keys.
    let parts = match describe::choice_of_tag(&parts) {
        Some(choice) if present.is_some_and(|kind| *kind != value) => choice,
        _ => &parts,
    };
    let mut place = &mut root;
    for (index, part) in parts.iter().copied().enumerate() {
        let variants = describe::untagged_variants(&parts[..index]);
        if variants.contains(&part) && place.get(part).is_none() {
            if index + 1 < parts.len() {
                return Err(wrong_key(KeyError::NotChosen {
                    key: parts[..index].join("."),
                    chosen: variant_name(place),
                    part: part.into(),
                }));
            }
            *place = Value::Table(Table::new());
        }
        let next = match place {
            Value::Table(table) => {
                if !table.contains_key(part) && missing.is_none() {
                    let known = if variants.is_empty() {
                        describe::keys(&parts[..index], table)
                    } else {
                        variants.iter().map(ToString::to_string).collect()
                    };
                    let is_optional =
                        variants.contains(&part) || describe::is_optional(&parts[..=index]);
                    let part = part.into();
                    let unknown = KeyError::Unknown { part, known };
                    missing = Some((!is_optional).then_some(unknown));
                }
                let empty = || Value::Table(Table::new());
                Ok(table.entry(part).or_insert_with(empty))
            }
            Value::Array(array) => {
                let count = array.len();
                part.parse::<usize>()
                    .ok()
                    .and_then(|index| array.get_mut(index))
                    .ok_or_else(|| KeyError::NoItem {
                        part: part.into(),
                        count,
                    })
            }
            _ => Err(KeyError::InsideValue(part.into())),
        };
        place = next.map_err(wrong_key)?;
    }
    *place = match (&*place, value) {
        // An integer is accepted as a number.
        (Value::Float(_), Value::Integer(integer)) => Value::Float(integer as f64),
        (_, Value::String(name)) => describe::chosen(parts, name),
        (_, value) => value,
    };
    let Value::Table(table) = root else {
        return Err(wrong());
    };
    from_table(None, table).map_err(|error| missing.flatten().map_or(error, wrong_key))
}

/// Returns the key by which an override `key=value` sets `taken`: a key inside it is its own, a table around it that
/// contains it sets `taken`. `None` if the override leaves it alone.
pub fn sets<'a>(text: &'a str, taken: &'a str) -> Option<&'a str> {
    let (key, value) = text.split_once('=').unwrap_or((text, ""));
    let (key, value) = (key.trim(), value.trim());
    if key == taken || inside(key, taken).is_some() {
        return Some(key);
    }
    let (rest, value) = (inside(taken, key)?, parsed(value));
    let set = rest
        .split('.')
        .try_fold(&value, |value, part| value.get(part));
    set.map(|_| taken)
}

/// Returns the key of the first override that sets nothing in the tables `used`.
pub fn first_outside<'a>(overrides: &'a [String], used: &[&str]) -> Option<&'a str> {
    let mut keys = overrides.iter().map(|text| {
        text.split_once('=')
            .map_or(text.as_str(), |(key, _)| key)
            .trim()
    });
    keys.find(|key| {
        !used
            .iter()
            .any(|table| key.split('.').next() == Some(table))
    })
}

/// Returns the rest of a key that lies inside another.
fn inside<'a>(key: &'a str, outer: &str) -> Option<&'a str> {
    key.strip_prefix(outer)?.strip_prefix('.')
}

/// Reads the value of an override. A bare word is a string, so that names need no nested quotes.
fn parsed(value: &str) -> Value {
    format!("value = {value}")
        .parse::<Table>()
        .ok()
        .and_then(|mut table| table.remove("value"))
        .unwrap_or_else(|| Value::String(value.into()))
}

/// Returns the name of the variant that a choice without a tag has.
fn variant_name(choice: &Value) -> String {
    match choice {
        Value::String(name) => name.clone(),
        Value::Table(table) => table.keys().next().cloned().unwrap_or_default(),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::{first_outside, sets};

    #[test]
    fn an_override_outside_the_used_tables_is_found() {
        for (text, outside) in [
            ("arm.height_m=0.36", None),
            (" arm = { height_m = 0.36 }", None),
            ("run.seed=3", Some("run.seed")),
            (" run = { seed = 3 }", Some("run")),
            ("arm_model.height_m=0.36", Some("arm_model.height_m")),
            ("armature", Some("armature")),
        ] {
            let overrides = ["belt.friction=0.5", text].map(String::from);
            assert_eq!(
                first_outside(&overrides, &["arm", "belt"]),
                outside,
                "{text}"
            );
        }
    }

    #[test]
    fn an_override_sets_its_key_and_what_its_table_contains() {
        for (text, set) in [
            ("belt.friction=0.9", Some("belt.friction")),
            (" belt.friction = 0.9", Some("belt.friction")),
            (
                "belt.friction.of.nothing=1",
                Some("belt.friction.of.nothing"),
            ),
            ("belt={friction=0.9}", Some("belt.friction")),
            ("belt={ \"friction\" = 0.9 }", Some("belt.friction")),
            ("belt={profile={kind='constant',speed_m_s=-0.4}}", None),
            ("belt=friction", None),
            ("belt.frictional=1", None),
            ("belt", None),
            ("bel={friction=0.9}", None),
        ] {
            assert_eq!(sets(text, "belt.friction"), set, "{text}");
        }
        let deep = "controller.law.hybrid.friction";
        assert_eq!(
            sets("controller={law={hybrid={friction='model'}}}", deep),
            Some(deep)
        );
        assert_eq!(sets("controller.law=hybrid", deep), None);
    }
}

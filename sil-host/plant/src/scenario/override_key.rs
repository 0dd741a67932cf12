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
    // A bare word is a string, so that names need no nested quotes.
    let value = format!("value = {value}")
        .parse::<Table>()
        .ok()
        .and_then(|mut table| table.remove("value"))
        .unwrap_or_else(|| Value::String(value.into()));
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
        (_, Value::String(name)) => describe::chosen(&parts, name),
        (_, value) => value,
    };
    let Value::Table(table) = root else {
        return Err(wrong());
    };
    from_table(None, table).map_err(|error| missing.flatten().map_or(error, wrong_key))
}

/// Returns the name of the variant that a choice without a tag has.
fn variant_name(choice: &Value) -> String {
    match choice {
        Value::String(name) => name.clone(),
        Value::Table(table) => table.keys().next().cloned().unwrap_or_default(),
        other => other.to_string(),
    }
}

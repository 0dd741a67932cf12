//! Scenarios from TOML tables.

use toml::Table;

use super::error::{KeyError, ScenarioError};
use super::words::TomlError;
use super::{Scenario, describe, initial_key, reference_file};

/// Reads a table from TOML text; messages name its origin.
pub(super) fn parse(origin: &str, text: &str) -> Result<Table, ScenarioError> {
    text.parse().map_err(|error| ScenarioError::Syntax {
        origin: origin.into(),
        source: TomlError::new(error, text),
    })
}

/// Reads a scenario from a table; its numbers are not validated yet.
pub(super) fn from_table(
    origin: Option<&str>,
    mut table: Table,
) -> Result<Scenario, ScenarioError> {
    reference_file::expand(&mut table).map_err(|reason| ScenarioError::Key {
        origin: origin.map(str::to_owned),
        key: "controller.reference".into(),
        source: KeyError::File(reason),
    })?;
    let scenario = Scenario::from_keys(table).map_err(|(path, source)| {
        let key = path.to_string();
        let parts: Vec<&str> = key
            .split(['.', '[', ']'])
            .filter(|it| !it.is_empty())
            .collect();
        let setting = describe::setting(&parts);
        ScenarioError::Key {
            origin: origin.map(str::to_owned),
            source: KeyError::Value { source, setting },
            key,
        }
    })?;
    initial_key::check(&scenario.initial).map_err(|(key, source)| ScenarioError::Key {
        origin: origin.map(str::to_owned),
        key: key.into(),
        source,
    })?;
    Ok(scenario)
}

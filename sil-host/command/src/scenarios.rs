//! `painleve scenarios`: lists and prints scenarios.

use clap::Args;
use painleve_plant::scenario::{Scenario, built_in, describe};

use painleve_process::terminal;
use serde_json::{Value, json};

use super::output_error::{InputError, output};
use super::{CommandError, say};

/// Options of `painleve scenarios`.
#[derive(Debug, Args)]
pub struct ScenariosArguments {
    /// Print this scenario (a name or a file) as TOML with every key, its range, unit and meaning.
    scenario: Option<String>,
    /// Print a JSON Schema of scenario files, with which editors complete and check them.
    #[arg(long, conflicts_with = "scenario")]
    schema: bool,
    /// Print JSON: names and descriptions, or the whole scenario.
    #[arg(long, conflicts_with = "schema")]
    json: bool,
    /// Print only the keys whose values are not the defaults.
    #[arg(long, conflicts_with = "json")]
    diff: bool,
    /// Override one key, for example belt.friction=0.4; may be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
}

/// Lists the built-in scenarios, or prints one of them or the schema.
///
/// # Errors
/// [`CommandError`] if the scenario is invalid, or the output cannot be written.
pub fn run(arguments: &ScenariosArguments) -> Result<(), CommandError> {
    let of_scenario = [
        ("--diff", arguments.diff),
        ("--set", !arguments.overrides.is_empty()),
    ];
    InputError::check_needed("SCENARIO", arguments.scenario.is_some(), &of_scenario)?;
    if let Some(name) = &arguments.scenario {
        let scenario = Scenario::load(name, &arguments.overrides)?;
        if arguments.json {
            return say(scenario.to_json().map_err(output)?);
        }
        let text = if arguments.diff {
            scenario.to_brief_toml()
        } else {
            scenario.to_commented_toml()
        };
        return say(text.trim_end());
    }
    if arguments.schema {
        return say(format!("{:#}", describe::json_schema()));
    }
    let load = |name| Scenario::load(name, &[]).map(|scenario| (name, scenario.description));
    let scenarios: Vec<_> = built_in::names().map(load).collect::<Result<_, _>>()?;
    if arguments.json {
        let entry = |(name, text): &(&str, String)| json!({ "name": name, "description": text });
        return say(Value::from_iter(scenarios.iter().map(entry)));
    }
    let mut table = terminal::table(["scenario", "description"]);
    for (name, description) in &scenarios {
        table.add_row([*name, description]);
    }
    say(terminal::readable_table(table))
}

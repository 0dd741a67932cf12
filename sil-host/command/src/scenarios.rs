//! `painleve scenarios`: lists and prints scenarios.

use clap::Args;
use painleve_plant::scenario::{Scenario, built_in, describe};

use painleve_process::terminal;
use serde_json::{Value, json};

use super::json::JsonOption;
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
    /// List every key with its default, range and meaning, or those that contain PART.
    #[arg(long, value_name = "PART", num_args = 0..=1, default_missing_value = "", conflicts_with_all = ["scenario", "schema"])]
    keys: Option<String>,
    /// Print JSON: names and descriptions, the whole scenario, or the list of keys.
    #[arg(long, conflicts_with = "schema")]
    json: bool,
    /// Print only the keys whose values are not the defaults.
    #[arg(long, conflicts_with = "json")]
    diff: bool,
    /// Override one key, for example belt.friction=0.4; may be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
}

/// Lists the built-in scenarios or all keys, or prints a scenario or the schema.
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
    if let Some(part) = &arguments.keys {
        return list_keys(
            part,
            JsonOption {
                json: arguments.json,
            },
        );
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

fn list_keys(part: &str, json: JsonOption) -> Result<(), CommandError> {
    let mut settings = describe::settings();
    settings.retain(|setting| setting.key.contains(part));
    if settings.is_empty() {
        return Err(InputError::NoKey(part.into()).into());
    }
    let mut table = terminal::table(["key", "default", "allowed", "meaning"]);
    for setting in &settings {
        let key = match setting.kinds.as_slice() {
            [] => setting.key.clone(),
            kinds => format!("{} ({})", setting.key, kinds.join(", ")),
        };
        table.add_row([&key, &setting.default, &setting.allowed, &setting.meaning]);
    }
    json.say(&settings, terminal::readable_table(table))
}

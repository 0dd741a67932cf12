//! `painleve scenarios`: lists and prints scenarios.

use clap::Args;
use comfy_table::presets::UTF8_FULL_CONDENSED;
use comfy_table::{ContentArrangement, Table};
use painleve_plant::scenario::{Scenario, built_in, describe};

use painleve_system::terminal;

use super::{CommandError, say};

/// Options of `painleve scenarios`.
#[derive(Debug, Args)]
pub struct ScenariosArguments {
    /// Print this scenario (a name or a file) as TOML with every key, its range, unit and meaning.
    scenario: Option<String>,
    /// Print a JSON Schema of scenario files, with which editors complete and check them.
    #[arg(long, conflicts_with = "scenario")]
    schema: bool,
    /// Override one key, for example belt.friction=0.4; may be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE", requires = "scenario")]
    overrides: Vec<String>,
}

/// Lists the built-in scenarios, or prints one of them or the schema.
pub fn run(arguments: &ScenariosArguments) -> Result<(), CommandError> {
    if let Some(name) = &arguments.scenario {
        let scenario = Scenario::load(name, &arguments.overrides)?;
        return say(scenario.to_commented_toml().trim_end());
    }
    if arguments.schema {
        return say(format!("{:#}", describe::json_schema()));
    }
    let mut table = Table::new();
    table
        .load_style(UTF8_FULL_CONDENSED)
        .set_content_arrangement(ContentArrangement::Dynamic)
        .set_header(["scenario", "description"]);
    for name in built_in::names() {
        table.add_row([name, &Scenario::load(name, &[])?.description]);
    }
    say(terminal::readable(table))
}

//! `painleve scenarios`: what can be run.

use clap::Args;
use comfy_table::presets::UTF8_FULL_CONDENSED;
use comfy_table::{ContentArrangement, Table};
use painleve_plant::scenario::{Scenario, built_in};

use super::{CommandError, say};

/// Options of `painleve scenarios`.
#[derive(Debug, Args)]
pub struct ScenariosArguments {
    /// Print this scenario (a name or a file) as TOML with every key.
    scenario: Option<String>,
    /// Override one key of it, as in belt.friction=0.4; may be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE", requires = "scenario")]
    overrides: Vec<String>,
}

/// Lists the built-in scenarios or prints one.
pub fn run(arguments: &ScenariosArguments) -> Result<(), CommandError> {
    if let Some(name) = &arguments.scenario {
        let scenario = Scenario::load(name, &arguments.overrides)?;
        let text =
            toml::to_string(&scenario).map_err(|error| CommandError::Output(error.to_string()))?;
        return say(text.trim_end());
    }
    let mut table = Table::new();
    table
        .load_style(UTF8_FULL_CONDENSED)
        .set_content_arrangement(ContentArrangement::Dynamic)
        .set_header(["scenario", "what it is"]);
    for name in built_in::names() {
        table.add_row([name, &Scenario::load(name, &[])?.description]);
    }
    say(table)
}

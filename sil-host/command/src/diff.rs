//! `painleve diff`: the keys in which two scenarios or records differ.

use clap::Args;
use painleve_process::terminal;
use serde_json::json;

use super::CommandError;
use super::given_scenario;
use super::json::JsonOption;

/// Options of `painleve diff`.
#[derive(Debug, Args)]
pub struct DiffArguments {
    /// A built-in scenario, a scenario file, or a record (.mcap).
    first: String,
    /// Another one.
    second: String,
    #[command(flatten)]
    json: JsonOption,
}

/// Prints every key whose values differ.
///
/// # Errors
/// [`CommandError`] if a scenario is invalid, or the output cannot be written.
pub fn run(arguments: &DiffArguments) -> Result<(), CommandError> {
    let [first, second] =
        [&arguments.first, &arguments.second].map(|name| given_scenario::load(name));
    let differences = first?.differences(&second?);
    let result = json!({
        "first": arguments.first,
        "second": arguments.second,
        "differences": differences,
    });
    if differences.is_empty() {
        return arguments.json.say(&result, "no key differs");
    }
    let mut table = terminal::table(["key", &arguments.first, &arguments.second]);
    for one in &differences {
        table.add_row(one.cells());
    }
    arguments.json.say(&result, terminal::readable_table(table))
}

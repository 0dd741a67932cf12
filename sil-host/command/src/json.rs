//! `--json`: the result of a command as one JSON object instead of text.

use std::fmt::Display;

use clap::Args;
use serde::Serialize;

use super::output_error::output;
use super::{CommandError, say};

/// The option `--json` of commands that print one line or a table.
#[derive(Clone, Copy, Debug, Default, Args)]
pub struct JsonOption {
    /// Print one JSON object on stdout instead of text.
    #[arg(long)]
    pub json: bool,
}

impl JsonOption {
    /// Prints a result as text, or as JSON if requested.
    ///
    /// # Errors
    /// [`CommandError`] if standard output cannot be written.
    pub fn say(self, result: &impl Serialize, text: impl Display) -> Result<(), CommandError> {
        if self.json {
            say(serde_json::to_string(result).map_err(output)?)
        } else {
            say(text)
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::{Command, CommandFactory};

    /// Commands without a result on standard output, and two that print a file: a script for the shell, a scenario.
    const WITHOUT_RESULT: [&str; 6] = [
        "controller",
        "qemu",
        "drivers",
        "serial",
        "completions",
        "arm",
    ];

    /// Returns the names of commands without `--json`.
    fn without_json(command: &Command) -> Vec<String> {
        let children: Vec<&Command> = command.get_subcommands().collect();
        if !children.is_empty() {
            return children.into_iter().flat_map(without_json).collect();
        }
        let has_json = command
            .get_arguments()
            .any(|it| it.get_long() == Some("json"));
        let names = (!has_json).then(|| command.get_name().to_owned());
        names.into_iter().collect()
    }

    #[test]
    fn every_command_with_a_result_has_the_option_json() {
        let mut without = without_json(&crate::Cli::command());
        without.sort();
        let mut expected = WITHOUT_RESULT.map(str::to_owned);
        expected.sort();
        assert_eq!(without, expected);
    }
}

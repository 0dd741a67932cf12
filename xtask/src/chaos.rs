//! `cargo xtask chaos`: the test in `tests/chaos`, on the program under test.

use clap::Args;

use crate::command::ChoreError;
use crate::under_test::{chaos, run_on_program};

#[path = "../../tests/chaos/src/arguments.rs"]
mod arguments;

/// Options of the test, which `--help` lists.
#[derive(Debug, Args)]
#[command(disable_help_flag = true)]
pub struct ChaosArguments {
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    options: Vec<String>,
}

/// Runs the part that belongs to every `cargo xtask test`.
///
/// # Errors
/// If a flaw is found.
pub fn short() -> Result<(), ChoreError> {
    start(&["--trials=120", "--stop-after-s=20", "--end-s=8"])
}

/// Runs the part that belongs to `cargo xtask test --all`.
///
/// # Errors
/// If a flaw is found.
pub fn nightly() -> Result<(), ChoreError> {
    start(&["--trials=1000", "--end-s=8"])
}

/// Runs the test.
///
/// # Errors
/// If it does not build, finds a flaw, or disturbs nothing.
pub fn run(arguments: &ChaosArguments) -> Result<(), ChoreError> {
    let options: Vec<_> = arguments.options.iter().map(String::as_str).collect();
    // Help and refusals need no build.
    if let Err(answer) = checked(&options) {
        answer.exit();
    }
    start(&options)
}

fn checked(options: &[&str]) -> Result<arguments::ChaosArguments, clap::Error> {
    let name = ["cargo xtask chaos"];
    arguments::ChaosArguments::read(name.iter().chain(options))
}

fn start(options: &[&str]) -> Result<(), ChoreError> {
    run_on_program(&chaos().to_string_lossy(), options, &[])
}

#[cfg(test)]
mod tests {
    use clap::error::ErrorKind;

    use super::*;

    #[test]
    fn help_and_unknown_options_are_answered_before_anything_is_built() {
        for (option, expected) in [
            ("--help", ErrorKind::DisplayHelp),
            ("--trails=5", ErrorKind::UnknownArgument),
            ("--host=board", ErrorKind::InvalidValue),
        ] {
            assert_eq!(checked(&[option]).unwrap_err().kind(), expected, "{option}");
        }
        checked(&["--first=300", "--trials=1", "--jobs=1"]).unwrap();
        checked(&["--trials=120", "--stop-after-s=20", "--end-s=8"]).unwrap();
    }

    #[test]
    fn options_by_which_no_trial_begins_are_refused() {
        for (options, expected) in [
            (
                &["--jobs=0"][..],
                "invalid value '0' for '--jobs <JOBS>': 0 is not in 1..=256",
            ),
            (
                &["--trials=0"],
                "invalid value '0' for '--trials <TRIALS>': 0 is not in 1..=",
            ),
            (
                &["--first=0"],
                "invalid value '0' for '--first <FIRST>': 0 is not in 1..=",
            ),
            (
                &["--last=0"],
                "invalid value '0' for '--last <LAST>': 0 is not in 1..=",
            ),
            (
                &["--stop-after-s=0"],
                "'0' for '--stop-after-s <SECONDS>': 0 is not in 1..=",
            ),
            (
                &["--end-s=0"],
                "'0' for '--end-s <END_S>': 0 is not in 1..=3600",
            ),
            (
                &["--first=10", "--last=5"],
                "--last 5 is before --first 10: give --last from 10 to 1000000",
            ),
            (&["--first=301"], "--last 300 is before --first 301"),
        ] {
            let message = checked(options).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
        }
    }
}

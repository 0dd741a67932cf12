//! The program under test: where it is, how it is built, and how tests are told of it.

use std::path::PathBuf;
use std::process::{Command, Stdio};

use serde_json::Value;

use crate::build_fw;
use crate::command::{ChoreError, cargo, output, run_cargo, run_with, workspace};

/// The profile of the program under test and of all tests.
pub const PROFILE: &str = "verify";

const PROGRAM: &str = "painleve";
const CHAOS: &str = "chaos";

/// Returns the path of the program under test.
pub fn program() -> PathBuf {
    built(PROGRAM)
}

/// Returns the path of the program of `tests/chaos`, which disturbs it.
pub fn chaos() -> PathBuf {
    built(CHAOS)
}

/// Returns the path of a program that is built with the profile of the tests.
pub fn built(name: &str) -> PathBuf {
    workspace().join("target").join(PROFILE).join(name)
}

/// Builds the program under test, the one that disturbs it, and all tests: in one call, so that each dependency is
/// compiled with one set of features, once.
///
/// # Errors
/// If they do not build.
pub fn build_program() -> Result<(), ChoreError> {
    let tests = ["build", "--profile", PROFILE, "--workspace", "--tests"];
    run_cargo(&[&tests[..], &["--bin", PROGRAM, "--bin", CHAOS]].concat())
}

/// Returns what tells tests where program and images are; without it they build their own.
pub fn under_test() -> [(&'static str, PathBuf); 2] {
    [
        ("PAINLEVE_PROGRAM", program()),
        ("PAINLEVE_IMAGES", build_fw::folder()),
    ]
}

/// Builds images and program, and runs those tests whose names contain one of `names`; `selection` are options of
/// `cargo test`, `further` those of the tests.
///
/// # Errors
/// As [`run_with`], and if there is no test for a name.
pub fn run_tests(
    selection: &[&str],
    names: &[&str],
    further: &[&str],
    environment: &[(&str, &str)],
) -> Result<(), ChoreError> {
    let test = ["test", "--profile", PROFILE];
    let list = [&test[..], &["--quiet"], selection, &["--", "--list"]].concat();
    let listed = Command::new(cargo())
        .args(list)
        .current_dir(workspace())
        .stderr(Stdio::inherit())
        .output()
        .map_err(|cause| ChoreError(format!("cannot list the tests: {cause}")))?;
    let listed = String::from_utf8_lossy(&listed.stdout);
    let tests: Vec<_> = listed.lines().filter(|it| it.ends_with(": test")).collect();
    if let Some(name) = names
        .iter()
        .find(|name| !tests.iter().any(|it| it.contains(**name)))
    {
        return Err(ChoreError(format!("no test is named '{name}'")));
    }
    let run = [&test[..], selection, &["--"], names, further].concat();
    run_on_program(&cargo(), &run, environment)
}

/// Returns the JSON that a command of the program under test prints.
///
/// # Errors
/// If it does not start, fails or prints something else.
pub fn printed_json(arguments: &[&str]) -> Result<Value, ChoreError> {
    let mut command = Command::new(program());
    command.args(arguments).current_dir(workspace());
    let printed = output(command.stderr(Stdio::inherit()))?;
    let line = arguments.join(" ");
    serde_json::from_str(&printed)
        .map_err(|_| ChoreError(format!("`painleve {line}` printed no report")))
}

/// Builds images and program, and runs a program that tests them.
///
/// # Errors
/// As [`run_with`].
pub fn run_on_program(
    tester: &str,
    arguments: &[&str],
    environment: &[(&str, &str)],
) -> Result<(), ChoreError> {
    build_fw::run()?;
    build_program()?;
    let under_test = under_test().map(|(name, path)| (name, path.to_string_lossy().into_owned()));
    let under_test = under_test.iter().map(|(name, path)| (*name, path.as_str()));
    let environment: Vec<_> = under_test.chain(environment.iter().copied()).collect();
    run_with(tester, arguments, &environment)
}

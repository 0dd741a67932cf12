//! What runs tests or disturbs the program: program and images are built first, and their places told.

use std::path::PathBuf;

use crate::build_fw;
use crate::command::{ChoreError, build_program, program, run_with};

/// Returns what tells tests where program and images are; without it they build their own.
pub fn under_test() -> [(&'static str, PathBuf); 2] {
    [
        ("PAINLEVE_PROGRAM", program()),
        ("PAINLEVE_IMAGES", build_fw::folder()),
    ]
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

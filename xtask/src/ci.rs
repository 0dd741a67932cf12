//! `cargo xtask ci`: formatting, lints and tests, in this order.

use crate::command::{ChoreError, run_cargo};
use crate::test;

/// Runs the steps of continuous integration.
///
/// # Errors
/// If a step fails; later steps are not run.
pub fn run() -> Result<(), ChoreError> {
    run_cargo(&["fmt", "--all", "--check"])?;
    run_cargo(&[
        "clippy",
        "--workspace",
        "--all-targets",
        "--",
        "-D",
        "warnings",
    ])?;
    test::run()
}

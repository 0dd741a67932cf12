//! `cargo xtask ci`: formatting, lints, links in doc comments and tests, in this order.

use crate::command::{ChoreError, cargo, run_cargo, run_with};
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
    run_with(
        &cargo(),
        &["doc", "--workspace", "--no-deps"],
        &[("RUSTDOCFLAGS", "-D warnings")],
    )?;
    test::run()
}

//! `cargo xtask ci`: formatting, lints, links in doc comments and tests, in this order.

use crate::command::{ChoreError, cargo, run_cargo, run_with};
use crate::test::{self, TestArguments};
use crate::under_test::PROFILE;

/// Runs the steps of continuous integration.
///
/// # Errors
/// If a step fails; later steps are not run.
pub fn run() -> Result<(), ChoreError> {
    run_cargo(&["fmt", "--all", "--check"])?;
    let clippy = [
        "clippy",
        "--workspace",
        "--all-targets",
        "--profile",
        PROFILE,
    ];
    run_cargo(&[&clippy[..], &["--", "-D", "warnings"]].concat())?;
    run_with(
        &cargo(),
        &["doc", "--workspace", "--no-deps", "--profile", PROFILE],
        &[("RUSTDOCFLAGS", "-D warnings")],
    )?;
    test::run(&TestArguments::default())
}

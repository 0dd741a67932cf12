//! `cargo xtask test`: everything that must hold.

use crate::command::{ChoreError, run_cargo};

/// Builds the program as users run it, then runs every test of the workspace.
///
/// # Errors
/// The first command that fails.
pub fn run() -> Result<(), ChoreError> {
    // The end-to-end tests start the released program.
    run_cargo(&["build", "--release", "--package", "painleve-sil-host"])?;
    run_cargo(&["test", "--workspace"])
}

//! `cargo xtask test`: all tests.

use crate::command::{ChoreError, run_cargo};
use crate::{chaos, examples, python, setup, size};

/// Installs the ARM target and QEMU, builds images and programs as users do, then runs every test
/// of the workspace, every example, and the short part of chaos; compiles the Python package.
///
/// # Errors
/// If a step fails; later steps are not run.
pub fn run() -> Result<(), ChoreError> {
    setup::run()?;
    // Builds images and programs: the end-to-end tests start the release builds.
    size::run()?;
    run_cargo(&["test", "--workspace"])?;
    python::check()?;
    examples::run()?;
    chaos::short()
}

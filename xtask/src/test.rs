//! `cargo xtask test`: all tests.

use crate::command::{ChoreError, run_cargo};
use crate::{chaos, examples, fmu, python, setup, size};

/// Installs the tools that are missing, builds images and programs as users do, then runs every test
/// of the workspace, the tests of the Python package and of the FMU, every example, and the short part of chaos.
///
/// # Errors
/// If a step fails; later steps are not run.
pub fn run() -> Result<(), ChoreError> {
    setup::run()?;
    setup::install_test_tools();
    // Builds images and programs: the end-to-end tests start the release builds.
    size::run()?;
    run_cargo(&["test", "--workspace"])?;
    if setup::has_virtual_environments() {
        python::run_chore()?;
    } else {
        eprintln!("SKIPPED: the tests of the Python package (no python3-venv)");
        python::check()?;
    }
    if setup::has_virtual_environments() && setup::has_libclang() {
        fmu::run_chore()?;
    } else {
        eprintln!("SKIPPED: the FMU (no python3-venv or no libclang-dev)");
    }
    examples::run()?;
    chaos::short()
}

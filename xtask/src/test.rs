//! `cargo xtask test`: everything that must hold.

use crate::command::{ChoreError, run_cargo};
use crate::{build_fw, setup, size};

/// Installs the ARM target and QEMU, builds image and program as users run them, then
/// runs every test of the workspace.
///
/// # Errors
/// The first command that fails.
pub fn run() -> Result<(), ChoreError> {
    setup::run()?;
    build_fw::run()?;
    size::run()?;
    // The end-to-end tests start the released program.
    run_cargo(&["build", "--release", "--package", "painleve-sil-host"])?;
    run_cargo(&["test", "--workspace"])
}

//! `cargo xtask test`: everything that must hold.

use crate::command::{ChoreError, run_cargo};
use crate::{chaos, examples, setup, size};

/// Installs the ARM target and QEMU, builds image and program as users run them, then
/// runs every test of the workspace, every example, and the short part of chaos.
///
/// # Errors
/// The first command that fails.
pub fn run() -> Result<(), ChoreError> {
    setup::run()?;
    // Builds images and program: the end-to-end tests start the released ones.
    size::run()?;
    run_cargo(&["test", "--workspace"])?;
    examples::run()?;
    chaos::short()
}

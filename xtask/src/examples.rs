//! `cargo xtask examples`: builds and runs every example, each a crate outside the workspace.

use std::fs;
use std::path::PathBuf;

use crate::command::{ChoreError, run_cargo, workspace};

/// Runs every folder of `examples/` that has a `Cargo.toml`, in the order of their names.
///
/// # Errors
/// The first example that does not build, or that ends with an error.
pub fn run() -> Result<(), ChoreError> {
    for manifest in manifests()? {
        let manifest = manifest.to_string_lossy();
        // One target folder for all of them: they share most dependencies.
        run_cargo(&[
            "run",
            "--release",
            "--manifest-path",
            &manifest,
            "--target-dir",
            "target/examples",
        ])?;
    }
    Ok(())
}

fn manifests() -> Result<Vec<PathBuf>, ChoreError> {
    let folder = workspace().join("examples");
    let error = |cause| ChoreError(format!("cannot read {}: {cause}", folder.display()));
    let mut manifests = Vec::new();
    for entry in fs::read_dir(&folder).map_err(error)? {
        let manifest = entry.map_err(error)?.path().join("Cargo.toml");
        if manifest.is_file() {
            manifests.push(manifest);
        }
    }
    manifests.sort();
    Ok(manifests)
}

//! `cargo xtask examples`: builds, runs and tests every example; each is a crate outside the
//! workspace.

use std::fs;
use std::path::{Path, PathBuf};

use crate::command::{ChoreError, run_cargo, workspace};
use crate::{boards, build_fw};

/// A common target folder of all examples, because they share most dependencies.
const TARGET: &str = "target/examples";

/// Handles every folder of `examples/` that has a `Cargo.toml`, sorted by name: builds the image
/// named by `[package.metadata] image`, runs the program, then its tests.
///
/// # Errors
/// If an example does not build, ends with an error, or fails a test.
pub fn run() -> Result<(), ChoreError> {
    for manifest in manifests()? {
        let manifest_path = manifest.to_string_lossy();
        let of_example = ["--release", "--manifest-path", &manifest_path];
        for image in images(&manifest)? {
            let selection = [&of_example[..], &["--bin", &image]].concat();
            build_fw::build(&selection, TARGET, "release", &[&image])?;
        }
        for chore in ["run", "test"] {
            run_cargo(&[&[chore], &of_example[..], &["--target-dir", TARGET]].concat())?;
        }
    }
    Ok(())
}

/// Returns the microcontroller images of an example.
fn images(manifest: &Path) -> Result<Vec<String>, ChoreError> {
    let packages = boards::packages(manifest)?;
    let image =
        |package: &serde_json::Value| package["metadata"]["image"].as_str().map(str::to_owned);
    Ok(packages.iter().filter_map(image).collect())
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

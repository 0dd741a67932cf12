//! `cargo xtask examples`: builds, runs and tests every example; each is a crate outside the
//! workspace.

use std::fs;
use std::path::{Path, PathBuf};

use crate::command::{ChoreError, run_cargo, workspace};
use crate::{boards, build_fw};

/// A common target folder of all examples, because they share most dependencies.
const TARGET: &str = "target/examples";

/// A firmware that is not ours, with the controller in it.
const OWN_FIRMWARE: &str = "examples/own-firmware/Cargo.toml";

/// Arguments of Cargo for it.
const OF_OWN_FIRMWARE: [&str; 3] = ["--locked", "--manifest-path", OWN_FIRMWARE];

/// The targets for which it is built, and what of it: `cortex-m-rt`, with which its program starts, is for ARM. The
/// first is that of the boards.
pub const CHIPS: [(&str, &str); 4] = [
    (build_fw::TARGET, "--bins"),
    ("thumbv6m-none-eabi", "--bins"),
    ("thumbv8m.main-none-eabihf", "--bins"),
    ("riscv32imac-unknown-none-elf", "--lib"),
];

/// Builds the example of a firmware for the boards' chip.
///
/// # Errors
/// If it does not build.
pub fn own_firmware() -> Result<(), ChoreError> {
    own_firmware_for(&CHIPS[..1])
}

fn own_firmware_for(chips: &[(&str, &str)]) -> Result<(), ChoreError> {
    for &(chip, part) in chips {
        build_fw::build(
            chip,
            &[&[part], &OF_OWN_FIRMWARE[..]].concat(),
            TARGET,
            "debug",
            &[],
        )?;
    }
    Ok(())
}

/// Builds the firmware for all its chips and runs its tests on this machine. Then, for every other folder of `examples/` that
/// has a `Cargo.toml`, sorted by name: builds the image named by `[package.metadata] image`, runs the program, then its tests.
///
/// # Errors
/// If an example does not build, ends with an error, or fails a test.
pub fn run() -> Result<(), ChoreError> {
    own_firmware_for(&CHIPS)?;
    let test = ["test", "--lib", "--target-dir", TARGET];
    run_cargo(&[&test[..], &OF_OWN_FIRMWARE].concat())?;
    for manifest in manifests()? {
        let manifest_path = manifest.to_string_lossy();
        let of_example = ["--locked", "--release", "--manifest-path", &manifest_path];
        for image in images(&manifest)? {
            let selection = [&of_example[..], &["--bin", &image]].concat();
            build_fw::build(build_fw::TARGET, &selection, TARGET, "release", &[&image])?;
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
        if manifest.is_file() && !manifest.ends_with(OWN_FIRMWARE) {
            manifests.push(manifest);
        }
    }
    manifests.sort();
    Ok(manifests)
}

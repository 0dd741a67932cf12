//! `cargo xtask examples`: builds, runs and tests every example in Rust.

use crate::build_fw;
use crate::command::{self, ChoreError, run_cargo};
use crate::under_test::{PROFILE, built};

/// Target folder of the firmware that is not ours, which is no member of the workspace.
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

/// Programs with a law and a plant of one's own, members of the workspace.
const PROGRAMS: [&str; 2] = ["own-law", "own-plant"];

/// Builds the image with a law of its own.
///
/// # Errors
/// If it does not build.
pub fn own_law_image() -> Result<(), ChoreError> {
    let image = "own-law-f405".to_owned();
    let selection = [
        "--profile",
        build_fw::PROFILE,
        "--package",
        "own-law",
        "--bin",
        &image,
    ];
    build_fw::build(
        build_fw::TARGET,
        &selection,
        "target",
        build_fw::PROFILE,
        &[&image],
    )
}

/// Builds the firmware for all its chips and runs its tests on this machine; runs the programs with an own law and an own plant,
/// and their tests.
///
/// # Errors
/// If an example does not build, ends with an error, or fails a test.
pub fn run() -> Result<(), ChoreError> {
    own_firmware_for(&CHIPS)?;
    let test = ["test", "--lib", "--target-dir", TARGET];
    run_cargo(&[&test[..], &OF_OWN_FIRMWARE].concat())?;
    own_law_image()?;
    // Of the whole workspace, so that no dependency is built again with other features.
    let workspace = ["--workspace", "--profile", PROFILE];
    let [law, plant] = PROGRAMS;
    run_cargo(&[&["build"], &workspace[..], &["--bin", law, "--bin", plant]].concat())?;
    for example in PROGRAMS {
        command::run(&built(example).to_string_lossy(), &[])?;
    }
    let test = ["--test", "command", "--", "--include-ignored"];
    run_cargo(&[&["test"], &workspace[..], &test].concat())
}

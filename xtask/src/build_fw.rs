//! `cargo xtask build-fw`: the controller's images for the microcontroller.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::boards;
use crate::command::{ChoreError, cargo, run_with, say, workspace};
use crate::files::copy;

/// The boards' target.
pub const TARGET: &str = "thumbv7em-none-eabihf";

/// The profile of the images.
pub const PROFILE: &str = "firmware";

/// Debian's own compiler, from the packages `rustc-web` and `rust-web-src`.
const DEBIAN_RUSTC: &str = "/usr/bin/rustc";

/// Source of the target's core library.
enum Toolchain {
    /// Installed with this toolchain.
    Installed,
    /// Built from Debian's sources by Debian's compiler.
    Debian,
}

/// Builds every image and says where they are.
///
/// # Errors
/// As [`run`].
pub fn run_chore() -> Result<(), ChoreError> {
    run()?;
    for board in boards::all()? {
        for name in &board.images {
            say(&place(name))?;
        }
    }
    Ok(())
}

/// Returns the path of a built image in the workspace.
fn place(name: &str) -> String {
    format!("target/{TARGET}/{PROFILE}/{name}")
}

/// Builds every image.
///
/// # Errors
/// If the target is not installed, or the build fails.
pub fn run() -> Result<(), ChoreError> {
    let boards = boards::all()?;
    let mut selection = vec!["--profile", PROFILE, "--bins"];
    for board in &boards {
        selection.extend(["--package", &board.package]);
    }
    let images: Vec<_> = boards.iter().flat_map(|board| &board.images).collect();
    build(TARGET, &selection, "target", PROFILE, &images)
}

/// Builds for the target `chip` what `selection` selects for cargo, among it the programs `images`, with the profile
/// `profile` into the workspace's folder `target`.
///
/// # Errors
/// If the target is not installed, or the build fails.
pub fn build(
    chip: &str,
    selection: &[&str],
    target: &str,
    profile: &str,
    images: &[&String],
) -> Result<(), ChoreError> {
    let build = [&["build", "--target", chip], selection].concat();
    match toolchain(chip)? {
        Toolchain::Installed => {
            let build = [&build[..], &["--target-dir", target]].concat();
            // Incremental compilation makes larger and slower images, beyond their budgets.
            run_with(&cargo(), &build, &[("CARGO_INCREMENTAL", "0")])
        }
        Toolchain::Debian => {
            // A separate target folder, because objects of two compilers cannot be mixed.
            let folder = workspace().join("target/debian");
            let folder = folder.to_string_lossy();
            let build = [&build[..], &["-Zbuild-std=core", "--target-dir", &folder]].concat();
            let variable = chip.to_uppercase().replace(['-', '.'], "_");
            let linker = format!("CARGO_TARGET_{variable}_LINKER");
            let environment = [
                ("RUSTC", DEBIAN_RUSTC),
                ("RUSTC_BOOTSTRAP", "1"),
                // Debian's compiler lacks the linker that the target specifies. Those before 17 cannot remap `memory.x`.
                (&linker, "ld.lld-19"),
            ];
            run_with("/usr/bin/cargo", &build, &environment)?;
            for name in images {
                let built = workspace().join(format!("target/debian/{chip}/{profile}/{name}"));
                let image = workspace().join(format!("{target}/{chip}/{profile}/{name}"));
                copy(&built, &image)?;
            }
            Ok(())
        }
    }
}

/// Returns the folder of the built images.
pub fn folder() -> PathBuf {
    workspace().join(place(""))
}

/// Returns the path of a built image.
pub fn image(name: &str) -> PathBuf {
    workspace().join(place(name))
}

/// Returns whether `rustc` has the core library of a target.
pub fn target_is_installed(chip: &str) -> bool {
    let rustc = std::env::var("RUSTC").unwrap_or_else(|_| "rustc".into());
    let Ok(output) = Command::new(rustc)
        .args(["--print", "target-libdir", "--target", chip])
        .current_dir(workspace())
        .output()
    else {
        return false;
    };
    let folder = String::from_utf8_lossy(&output.stdout).trim().to_owned();
    std::fs::read_dir(folder).is_ok_and(|files| {
        files
            .flatten()
            .any(|file| file.file_name().to_string_lossy().starts_with("libcore-"))
    })
}

/// Returns whether Debian's compiler and the sources of its core library are installed.
pub fn debian_can_build() -> bool {
    let sysroot = Command::new(DEBIAN_RUSTC)
        .args(["--print", "sysroot"])
        .output();
    sysroot.is_ok_and(|output| {
        let sysroot = String::from_utf8_lossy(&output.stdout).trim().to_owned();
        Path::new(&sysroot)
            .join("lib/rustlib/src/rust/library/core")
            .exists()
    })
}

fn toolchain(chip: &str) -> Result<Toolchain, ChoreError> {
    if target_is_installed(chip) {
        Ok(Toolchain::Installed)
    } else if debian_can_build() {
        Ok(Toolchain::Debian)
    } else {
        Err(ChoreError(format!(
            "the Rust target {chip} is not installed: run `cargo xtask setup`"
        )))
    }
}

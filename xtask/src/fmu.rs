//! `cargo xtask fmu`: builds the plant as an FMU and checks it with FMPy.

use std::path::PathBuf;

use crate::command::{ChoreError, cargo, run, run_with, workspace};
use crate::{python, setup};

const ENVIRONMENT: &str = "target/python/fmu";
const FMPY: &str = "fmpy==0.3.*";

/// Builds `target/fmu/painleve.fmu` for this computer, validates and simulates it; needs libclang
/// (Debian: `libclang-dev`), Python 3.10 with `venv`, and the package index.
///
/// # Errors
/// If a step fails.
pub fn run_chore() -> Result<(), ChoreError> {
    // Asked before minutes of compilation.
    setup::require_virtual_environments()?;
    let fmu = build("target", &[])?;
    let python = python::environment(ENVIRONMENT, &[FMPY])?;
    run(&python, &["fmu/check.py", &fmu.to_string_lossy()])
}

/// Builds the FMU for this computer into a target folder, and returns its path.
///
/// # Errors
/// If libclang is missing or the build fails.
pub fn build(target: &str, environment: &[(&str, &str)]) -> Result<PathBuf, ChoreError> {
    setup::require_libclang()?;
    // The crate is a workspace of its own; its bundler takes the target folder from the environment.
    let bundle = ["run", "--release", "--locked"];
    let of = ["--manifest-path", "fmu/Cargo.toml"];
    let target = workspace().join(target);
    let folder = target.to_string_lossy();
    let folder = [("CARGO_TARGET_DIR", folder.as_ref())];
    let line = [&bundle[..], &of].concat();
    run_with(&cargo(), &line, &[&folder, environment].concat())?;
    Ok(target.join("fmu/painleve.fmu"))
}

//! `cargo xtask fmu`: builds the plant as an FMU and checks it with FMPy.

use crate::command::{ChoreError, cargo, run, run_with, workspace};

const FMU: &str = "target/fmu/painleve.fmu";
const ENVIRONMENT: &str = "target/python/fmu";
const FMPY: &str = "fmpy==0.3.*";

/// Builds `target/fmu/painleve.fmu` for this computer, validates and simulates it; needs libclang
/// (Debian: `libclang-dev`), Python 3.10 with `venv`, and the package index.
///
/// # Errors
/// If a step fails.
pub fn run_chore() -> Result<(), ChoreError> {
    // The crate is a workspace of its own; its bundler takes the target folder from the environment.
    let bundle = ["run", "--release", "--manifest-path", "fmu/Cargo.toml"];
    let target = workspace().join("target");
    let target = target.to_string_lossy();
    run_with(&cargo(), &bundle, &[("CARGO_TARGET_DIR", &target)])?;
    run("python3", &["-m", "venv", ENVIRONMENT])?;
    let python = format!("{ENVIRONMENT}/bin/python");
    run(&python, &["-m", "pip", "install", "--quiet", FMPY])?;
    run(&python, &["fmu/check.py", FMU])
}

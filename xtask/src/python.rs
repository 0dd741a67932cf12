//! `cargo xtask python`: builds the Python package, installs its wheel in a virtual environment, and tests it.

use std::path::PathBuf;

use crate::command::{ChoreError, run, workspace};
use crate::setup;

const MANIFEST: &str = "python/Cargo.toml";
const FOLDER: &str = "target/python/package";
const WHEELS: &str = "target/python/wheels";
/// The test's own requirements.
const TOOLS: [&str; 6] = [
    "maturin>=1.9,<2",
    "pytest",
    "gymnasium",
    "numpy",
    "pandas",
    "matplotlib",
];

/// Builds, installs and tests the package; needs Python 3.10 with `venv`, and the package index.
///
/// # Errors
/// If a step fails.
pub fn run_chore() -> Result<(), ChoreError> {
    let python = environment(FOLDER, &TOOLS)?;
    run(
        &format!("{FOLDER}/bin/maturin"),
        &[
            "build",
            "--profile",
            "verify",
            "--manifest-path",
            MANIFEST,
            "--target-dir",
            "target",
            "--out",
            WHEELS,
        ],
    )?;
    // Wheels of other versions stay in their folder.
    let wheel = wheel()?;
    let install = ["-m", "pip", "install", "--quiet", "--force-reinstall"];
    let file = ["--no-index", &wheel.to_string_lossy()];
    run(&python, &[&install[..], &file].concat())?;
    run(&python, &["-m", "pytest", "-q", "python/tests"])
}

/// Makes an environment with packages of the index in a folder of the workspace, and returns its Python.
///
/// # Errors
/// If Python lacks `venv`, or a package cannot be installed.
pub fn environment(folder: &str, packages: &[&str]) -> Result<String, ChoreError> {
    setup::require_virtual_environments()?;
    run("python3", &["-m", "venv", folder])?;
    let python = format!("{folder}/bin/python");
    let pip = ["-m", "pip", "install", "--quiet"];
    run(&python, &[&pip[..], packages].concat())?;
    Ok(python)
}

/// Returns the newest wheel that this chore has built.
///
/// # Errors
/// If there is none.
pub fn wheel() -> Result<PathBuf, ChoreError> {
    let files = std::fs::read_dir(workspace().join(WHEELS));
    let files = files.into_iter().flatten().flatten();
    let wheels = files.filter(|file| file.path().extension().is_some_and(|end| end == "whl"));
    let built = |file: &std::fs::DirEntry| file.metadata().and_then(|data| data.modified()).ok();
    let newest = wheels.max_by_key(built).map(|file| file.path());
    newest.ok_or_else(|| ChoreError(format!("no wheel in {WHEELS}: run `cargo xtask python`")))
}

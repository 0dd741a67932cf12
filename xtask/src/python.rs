//! `cargo xtask python`: builds the Python package, installs its wheel in a virtual environment, tests it,
//! and executes its notebook.

use crate::command::{ChoreError, run};

const MANIFEST: &str = "python/Cargo.toml";
const FOLDER: &str = "target/python/package";
const WHEELS: &str = "target/python/wheels";
/// The test's own requirements.
const TOOLS: [&str; 8] = [
    "maturin>=1.9,<2",
    "pytest",
    "gymnasium",
    "numpy",
    "pandas",
    "matplotlib",
    "nbconvert",
    "ipykernel",
];
const NOTEBOOK_PAGE_FOLDER: &str = "target/python";
const NOTEBOOK: &str = "python/notebooks/bounce_and_edge.ipynb";

/// Builds, installs and tests the package, and executes its notebook to `target/python`; needs Python 3.10 with `venv`, and the package index.
///
/// # Errors
/// If a step fails.
pub fn run_chore() -> Result<(), ChoreError> {
    run("python3", &["-m", "venv", FOLDER])?;
    let python = format!("{FOLDER}/bin/python");
    let pip = ["-m", "pip", "install", "--quiet"];
    run(&python, &[&pip[..], &TOOLS].concat())?;
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
    let install = [
        "--force-reinstall",
        "--no-index",
        "--find-links",
        WHEELS,
        "painleve",
    ];
    run(&python, &[&pip[..], &install].concat())?;
    run(&python, &["-m", "pytest", "-q", "python/tests"])?;
    let execute = ["-m", "nbconvert", "--to", "html", "--execute"];
    let to = ["--output-dir", NOTEBOOK_PAGE_FOLDER, NOTEBOOK];
    run(&python, &[&execute[..], &to].concat())
}

//! Virtual environments for tests of Python code.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::skipped;

/// Returns the folder of the repository.
pub fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Returns the Python of an environment with these packages, which is kept in the target folder; says
/// what is skipped where there is no Python or no package index.
pub fn python(environment: &str, packages: &[&str]) -> Option<PathBuf> {
    let folder = workspace().join("target/python").join(environment);
    let python = folder.join("bin/python");
    let installed = folder.join("installed");
    let quietly = |command: &mut Command| {
        let status = command.stdout(Stdio::null()).stderr(Stdio::null()).status();
        status.is_ok_and(|status| status.success())
    };
    if !installed.exists() {
        let created = quietly(Command::new("python3").args(["-m", "venv"]).arg(&folder));
        let pip = ["-m", "pip", "install", "--quiet", "--retries", "1"];
        if !created || !quietly(Command::new(&python).args(pip).args(packages)) {
            skipped(&format!(
                "no python3-venv, or {packages:?} cannot be installed"
            ));
            return None;
        }
        std::fs::write(&installed, packages.join("\n")).ok()?;
    }
    Some(python)
}

//! `cargo xtask setup`: installs the tools for building, emulating and testing the images.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::build_fw::{TARGET, debian_can_build, target_is_installed};
use crate::command::{ChoreError, run_with, workspace};

/// Executes the board's image in tests; see `tests/flash-image`.
const UNICORN: &str = "unicorn==2.1.4";

/// Installs the Rust target, QEMU and Unicorn, if missing.
///
/// # Errors
/// If neither rustup nor Debian provides the target, or an emulator cannot be installed.
pub fn run() -> Result<(), ChoreError> {
    if !target_is_installed()
        && run_with("rustup", &["target", "add", TARGET], &[]).is_err()
        && !debian_can_build()
    {
        eprintln!("rustup cannot add the target; falling back on Debian's compiler");
        install(&["rustc-web", "cargo-web", "rust-web-src", "lld"])?;
    }
    if !starts("qemu-system-arm") {
        install(&["qemu-system-arm"])?;
    }
    install_unicorn()?;
    eprintln!("ready: `cargo xtask build-fw` builds the images");
    Ok(())
}

/// Programs and files that tests beyond Rust use, each with the Debian package that provides it.
const TEST_TOOLS: [(&str, &str); 5] = [
    ("c++", "g++"),
    ("node", "nodejs"),
    ("chromium", "chromium"),
    ("rsvg-convert", "librsvg2-bin"),
    ("python3", "python3-venv"),
];

/// Installs what the tests of pages, pictures, examples, FMU and Python package use, if missing. If it cannot be
/// installed, those tests are skipped and say so.
pub fn install_test_tools() {
    let mut missing: Vec<&str> = TEST_TOOLS
        .iter()
        .filter(|(program, _)| !starts(program))
        .map(|(_, package)| *package)
        .collect();
    if !has_virtual_environments() && !missing.contains(&"python3-venv") {
        missing.push("python3-venv");
    }
    if !has_libclang() {
        missing.push("libclang-dev");
    }
    if missing.is_empty() {
        return;
    }
    if let Err(ChoreError(reason)) = install(&missing) {
        eprintln!(
            "{reason}\ntests that use {} are skipped",
            missing.join(", ")
        );
    }
}

/// Returns whether `python3 -m venv` can create environments with pip.
pub fn has_virtual_environments() -> bool {
    let modules = ["-c", "import venv, ensurepip"];
    Command::new("python3")
        .args(modules)
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|status| status.success())
}

/// Returns whether the system has libclang, where bindgen looks for it.
pub fn has_libclang() -> bool {
    let library = |folder: &Path| {
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        let mut names = entries.map(|entry| entry.file_name().to_string_lossy().into_owned());
        names.any(|name| {
            name.starts_with("libclang") && name.contains(".so") && !name.contains("cpp")
        })
    };
    let versions = std::fs::read_dir("/usr/lib")
        .into_iter()
        .flatten()
        .flatten();
    let mut folders: Vec<PathBuf> = versions.map(|entry| entry.path().join("lib")).collect();
    folders.extend(["/usr/lib", "/usr/lib64", "/usr/local/lib"].map(PathBuf::from));
    std::env::var_os("LIBCLANG_PATH").is_some() || folders.iter().any(|folder| library(folder))
}

/// Installs the prebuilt Unicorn from PyPI into an environment under `target/`.
fn install_unicorn() -> Result<(), ChoreError> {
    let environment = workspace().join("target/unicorn");
    let installed = environment.join("installed");
    if std::fs::read_to_string(&installed).is_ok_and(|version| version == UNICORN) {
        return Ok(());
    }
    let folder = environment.to_string_lossy();
    let make = || run_with("python3", &["-m", "venv", "--clear", &folder], &[]);
    if make().is_err() {
        install(&["python3-venv"])?;
        make()?;
    }
    let python = environment.join("bin/python");
    let pip = ["-m", "pip", "install", "--quiet", "--no-deps", UNICORN];
    run_with(&python.to_string_lossy(), &pip, &[])?;
    std::fs::write(&installed, UNICORN)
        .map_err(|cause| ChoreError(format!("cannot write {}: {cause}", installed.display())))
}

/// Returns whether a program can be started.
pub fn starts(program: &str) -> bool {
    Command::new(program)
        .arg("--version")
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|status| status.success())
}

/// Installs Debian packages, with sudo unless run as root.
fn install(packages: &[&str]) -> Result<(), ChoreError> {
    let names = packages.join(" ");
    if !starts("apt-get") {
        return Err(ChoreError(format!(
            "apt-get not found; install the equivalents of the Debian packages {names}"
        )));
    }
    let apt = |arguments: &[&str]| {
        let whoami = Command::new("id").arg("-u").output();
        let is_root = whoami.is_ok_and(|output| output.stdout == b"0\n");
        let mut line = Vec::new();
        if !is_root {
            line.push("apt-get");
        }
        line.extend(arguments);
        run_with(if is_root { "apt-get" } else { "sudo" }, &line, &[])
    };
    apt(&["update"])?;
    let install = ["install", "-y", "--no-install-recommends"];
    apt(&[&install, packages].concat())
}

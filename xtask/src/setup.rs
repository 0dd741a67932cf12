//! `cargo xtask setup`: installs the tools for building, emulating and testing the images.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use clap::Args;

use crate::build_fw::{debian_can_build, target_is_installed};
use crate::command::{ChoreError, run_with, starts, workspace};
use crate::examples::CHIPS;
use crate::files::unwritable;
use crate::policy;

/// Executes the board's image in tests; see `tests/flash-image`.
const UNICORN: &str = "unicorn==2.1.4";

/// Options of `cargo xtask setup`.
#[derive(Debug, Args)]
pub struct SetupArguments {
    /// Also install what `cargo xtask test --all` uses: Chromium, Node, Python's `venv`, libclang, C++, librsvg, the least Rust version.
    #[arg(long)]
    all: bool,
    /// Install Debian packages with sudo.
    #[arg(long)]
    sudo: bool,
}

/// Which tools are needed.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Tools {
    /// Those of the default tier of tests.
    Default,
    /// Those of all tests.
    All,
}

/// Programs and files that tests beyond the default tier use, each with the Debian package that provides it.
const FURTHER_TOOLS: [(&str, &str); 4] = [
    ("c++", "g++"),
    ("node", "nodejs"),
    ("chromium", "chromium"),
    ("rsvg-convert", "librsvg2-bin"),
];

/// Installs the tools that are missing.
///
/// # Errors
/// If a tool cannot be installed.
pub fn run(arguments: &SetupArguments) -> Result<(), ChoreError> {
    let tools = if arguments.all {
        Tools::All
    } else {
        Tools::Default
    };
    install_required(&CHIPS, arguments.sudo)?;
    if tools == Tools::All {
        install(&missing_further(), arguments.sudo)?;
        policy::install();
    }
    eprintln!("ready: `cargo xtask build-fw` builds the images");
    Ok(())
}

/// Installs what the tests of a tier need, without sudo. Returns the packages that could not be installed and that only
/// further tests need; those tests say that they are skipped.
///
/// # Errors
/// If a tool of the default tier cannot be installed.
pub fn install_missing(tools: Tools) -> Result<Vec<&'static str>, ChoreError> {
    let (chips, missing) = match tools {
        Tools::Default => (&CHIPS[..1], Vec::new()),
        Tools::All => (&CHIPS[..], missing_further()),
    };
    install_required(chips, false)?;
    let mut missing = match install(&missing, false) {
        Ok(()) => Vec::new(),
        Err(ChoreError(reason)) => {
            eprintln!("{reason}");
            missing
        }
    };
    if tools == Tools::All {
        missing.extend(policy::install());
    }
    Ok(missing)
}

/// Installs the Rust targets of chips, QEMU and Unicorn.
fn install_required(chips: &[(&str, &str)], sudo: bool) -> Result<(), ChoreError> {
    let chips = chips.iter().map(|(chip, _)| *chip);
    let missing: Vec<_> = chips.filter(|chip| !target_is_installed(chip)).collect();
    if !missing.is_empty() && !debian_can_build() {
        eprintln!("missing: the Rust targets {}", missing.join(", "));
        if run_with("rustup", &[&["target", "add"], &missing[..]].concat(), &[]).is_err() {
            eprintln!("rustup cannot add the targets; falling back on Debian's compiler");
            install(&["rustc-web", "cargo-web", "rust-web-src", "lld-19"], sudo)?;
        }
    }
    if !starts("qemu-system-arm") {
        install(&["qemu-system-arm"], sudo)?;
    }
    install_unicorn(sudo)
}

fn missing_further() -> Vec<&'static str> {
    let programs = FURTHER_TOOLS.iter().filter(|(program, _)| !starts(program));
    let mut missing: Vec<_> = programs.map(|(_, package)| *package).collect();
    if !has_virtual_environments() {
        missing.push("python3-venv");
    }
    if !has_libclang() {
        missing.push("libclang-dev");
    }
    missing
}

/// Checks that `python3 -m venv` can create environments with pip.
///
/// # Errors
/// The package to install.
pub fn require_virtual_environments() -> Result<(), ChoreError> {
    require(
        has_virtual_environments(),
        "Python 3 with venv is not installed",
        "python3-venv",
    )
}

/// Checks that the system has libclang, where bindgen looks for it.
///
/// # Errors
/// The package to install.
pub fn require_libclang() -> Result<(), ChoreError> {
    require(
        has_libclang(),
        "libclang is not installed, or LIBCLANG_PATH does not name its folder",
        "libclang-dev",
    )
}

/// Checks that a tool `is_here`, which a Debian package provides.
fn require(is_here: bool, otherwise: &str, package: &str) -> Result<(), ChoreError> {
    if is_here {
        return Ok(());
    }
    Err(ChoreError(format!(
        "{otherwise}; on Debian install it with `sudo apt-get install {package}`"
    )))
}

/// Returns whether `python3 -m venv` can create environments with pip.
fn has_virtual_environments() -> bool {
    let modules = ["-c", "import venv, ensurepip"];
    Command::new("python3")
        .args(modules)
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|status| status.success())
}

/// Returns whether the system has libclang, where bindgen looks for it: up to two folders deep among the libraries.
fn has_libclang() -> bool {
    let is_library = |path: &Path| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        name.starts_with("libclang") && name.contains(".so") && !name.contains("cpp")
    };
    let inside = |folder: PathBuf| {
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        entries.map(|entry| entry.path())
    };
    let mut places: Vec<PathBuf> = ["/usr/lib", "/usr/lib64", "/usr/local/lib"]
        .map(PathBuf::from)
        .into();
    let further = std::env::var_os("LD_LIBRARY_PATH").unwrap_or_default();
    places.extend(std::env::split_paths(&further));
    let mut is_found = std::env::var_os("LIBCLANG_PATH").is_some();
    for _ in 0..3 {
        places = places.into_iter().flat_map(inside).collect();
        is_found = is_found || places.iter().any(|path| is_library(path));
    }
    is_found
}

/// Installs the prebuilt Unicorn from PyPI into an environment under `target/`.
fn install_unicorn(sudo: bool) -> Result<(), ChoreError> {
    let environment = workspace().join("target/unicorn");
    let installed = environment.join("installed");
    if std::fs::read_to_string(&installed).is_ok_and(|version| version == UNICORN) {
        return Ok(());
    }
    let folder = environment.to_string_lossy();
    let make = || run_with("python3", &["-m", "venv", "--clear", &folder], &[]);
    if make().is_err() {
        install(&["python3-venv"], sudo)?;
        make()?;
    }
    let python = environment.join("bin/python");
    let pip = ["-m", "pip", "install", "--quiet", "--no-deps", UNICORN];
    run_with(&python.to_string_lossy(), &pip, &[])?;
    std::fs::write(&installed, UNICORN).map_err(|cause| unwritable(&installed, &cause))
}

/// Installs Debian packages; a user other than root must allow sudo.
fn install(packages: &[&str], sudo: bool) -> Result<(), ChoreError> {
    if packages.is_empty() {
        return Ok(());
    }
    let names = packages.join(" ");
    if !starts("apt-get") {
        return Err(ChoreError(format!(
            "apt-get not found; install the equivalents of the Debian packages {names}"
        )));
    }
    if !sudo && !nix::unistd::geteuid().is_root() {
        return Err(ChoreError(format!(
            "missing Debian packages: {names}; install them with `sudo apt-get install {names}` or `cargo xtask setup --sudo`"
        )));
    }
    eprintln!("installing the Debian packages {names}");
    let apt = |arguments: &[&str]| {
        if nix::unistd::geteuid().is_root() {
            run_with("apt-get", arguments, &[])
        } else {
            run_with("sudo", &[&["apt-get"], arguments].concat(), &[])
        }
    };
    apt(&["update"])?;
    let install = ["install", "-y", "--no-install-recommends"];
    apt(&[&install, packages].concat())
}

#[cfg(test)]
mod tests {
    use super::require;

    #[test]
    fn a_missing_tool_is_named_with_its_package() {
        assert!(require(true, "a tool is missing", "a-package").is_ok());
        let message = require(false, "a tool is missing", "a-package").unwrap_err();
        assert_eq!(
            message.to_string(),
            "a tool is missing; on Debian install it with `sudo apt-get install a-package`"
        );
    }
}

//! `cargo xtask setup`: what building and running the images needs.

use std::process::{Command, Stdio};

use crate::build_fw::{TARGET, debian_can_build, target_is_installed};
use crate::command::{ChoreError, run_with};

/// Adds the Rust target and installs QEMU, unless they are there.
///
/// # Errors
/// If neither rustup nor Debian has the target, or QEMU cannot be installed.
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
    eprintln!("ready: `cargo xtask build-fw` builds the images");
    Ok(())
}

/// Whether a program is there.
pub fn starts(program: &str) -> bool {
    Command::new(program)
        .arg("--version")
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|status| status.success())
}

/// Installs Debian packages, with sudo unless this is root.
fn install(packages: &[&str]) -> Result<(), ChoreError> {
    let names = packages.join(" ");
    if !starts("apt-get") {
        return Err(ChoreError(format!(
            "this is no Debian: install what its packages {names} hold"
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

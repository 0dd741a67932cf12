//! What `cargo xtask test --all` checks of the workspace as a whole: that the least Rust version compiles it, that links
//! in its doc comments lead somewhere, and that its dependencies have the licences and come from the sources that `deny.toml` allows.

use std::process::{Command, Stdio};

use crate::command::{ChoreError, cargo, run, run_with, starts};
use crate::under_test::PROFILE;

/// The least Rust version, from the workspace's `Cargo.toml`.
const LEAST_RUST: &str = env!("CARGO_PKG_RUST_VERSION");

/// Checker of licences and sources; installed by hand, because its compilation takes minutes.
const DENY: &str = "cargo-deny";

/// Every workspace with a lock file of its own.
const WORKSPACES: [&str; 3] = [
    "Cargo.toml",
    "fmu/Cargo.toml",
    "examples/own-firmware/Cargo.toml",
];

/// Installs the least Rust version, if rustup can, and returns what is missing.
pub fn install() -> Vec<&'static str> {
    let install = ["toolchain", "install", LEAST_RUST, "--profile", "minimal"];
    let has_rust = has_least_rust() || run("rustup", &install).is_ok();
    [(has_rust, "the least Rust version"), (starts(DENY), DENY)]
        .into_iter()
        .filter_map(|(has, tool)| (!has).then_some(tool))
        .collect()
}

fn has_least_rust() -> bool {
    Command::new("rustup")
        .args(["run", LEAST_RUST, "rustc", "--version"])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|status| status.success())
}

/// Checks that the least Rust version compiles what users build, if it is installed; tests may need a newer one.
///
/// # Errors
/// If it does not.
pub fn least_rust() -> Result<(), ChoreError> {
    if !has_least_rust() {
        return Ok(());
    }
    let check = ["check", "--workspace", "--profile", PROFILE];
    run(
        "rustup",
        &[&["run", LEAST_RUST, "cargo"], &check[..]].concat(),
    )
}

/// Checks the links in the doc comments of all crates.
///
/// # Errors
/// If one leads nowhere.
pub fn doc_comments() -> Result<(), ChoreError> {
    run_with(
        &cargo(),
        &["doc", "--workspace", "--no-deps", "--profile", PROFILE],
        &[("RUSTDOCFLAGS", "-D warnings")],
    )
}

/// Checks licences and sources of the dependencies, if `cargo deny` is installed. Its advisories come from a database that changes
/// without a change here.
///
/// # Errors
/// If a dependency is not allowed.
pub fn dependencies() -> Result<(), ChoreError> {
    if !starts(DENY) {
        return Ok(());
    }
    for manifest in WORKSPACES {
        let of = ["deny", "--manifest-path", manifest, "--config", "deny.toml"];
        let check = ["check", "licenses", "bans", "sources"];
        run("cargo", &[&of[..], &check].concat())?;
    }
    Ok(())
}

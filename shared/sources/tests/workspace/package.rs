//! The crates that are useful without this workspace can be packaged: none of them needs a file outside its folder. What is
//! published beside them has their version.

use std::path::{Path, PathBuf};
use std::process::Command;

const PUBLISHED: [&str; 4] = [
    "painleve-sources",
    "painleve-shared",
    "painleve-firmware",
    "painleve-drivers",
];

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn package(more: &[&str]) {
    let output = Command::new(env!("CARGO"))
        .args(["package", "--allow-dirty", "--offline"])
        .args(PUBLISHED.map(|name| format!("--package={name}")))
        .args(more)
        .env("CARGO_PROFILE_DEV_DEBUG", "0")
        .current_dir(workspace())
        .output()
        .unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{message}");
}

/// Cargo compiles each from its package, against the packages of the others.
#[test]
#[ignore = "compiles their dependencies"]
fn published_crates_compile_from_their_packages() {
    package(&[]);
}

#[test]
fn published_crates_can_be_packaged_and_read_no_siblings() {
    package(&["--no-verify"]);
    for folder in ["shared", "shared/sources", "firmware", "firmware/drivers"] {
        let script = workspace().join(folder).join("build.rs");
        let script = std::fs::read_to_string(script).unwrap_or_default();
        assert!(
            !script.contains("../"),
            "{folder}/build.rs reads its siblings"
        );
    }
}

#[test]
fn citation_and_fmu_have_the_version_of_the_workspace() {
    for (file, stated) in [
        (
            "CITATION.cff",
            concat!("version: ", env!("CARGO_PKG_VERSION")),
        ),
        (
            "fmu/Cargo.toml",
            concat!("version = \"", env!("CARGO_PKG_VERSION"), "\""),
        ),
    ] {
        let text = std::fs::read_to_string(workspace().join(file)).unwrap();
        assert!(
            text.lines().any(|line| line == stated),
            "{file} does not state '{stated}'"
        );
    }
}

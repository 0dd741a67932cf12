//! The crates that are useful without this workspace can be packaged: none of them needs a file outside its folder. What is
//! published beside them has their version.

use std::fs;
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

fn run(command: &mut Command) {
    let output = command.current_dir(workspace()).output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{message}");
}

fn package(target: &Path) {
    run(Command::new(env!("CARGO"))
        .args(["package", "--no-verify", "--allow-dirty", "--offline"])
        .args(PUBLISHED.map(|name| format!("--package={name}")))
        .arg("--target-dir")
        .arg(target));
}

#[test]
fn published_crates_can_be_packaged_and_read_no_siblings() {
    package(&workspace().join("target"));
    for folder in ["shared", "shared/sources", "firmware", "firmware/drivers"] {
        let script = workspace().join(folder).join("build.rs");
        let script = fs::read_to_string(script).unwrap_or_default();
        assert!(
            !script.contains("../"),
            "{folder}/build.rs reads its siblings"
        );
    }
}

/// Without `--no-verify`, cargo would compile a package against siblings that it unpacked for an earlier one of the same
/// version.
#[test]
#[ignore = "compiles their dependencies"]
fn published_crates_compile_from_their_packages() {
    let target = workspace().join("target/packaged");
    package(&target);
    // What a former package had must not remain.
    let _ = fs::remove_dir_all(target.join("crates"));
    fs::create_dir_all(target.join("crates")).unwrap();
    let mut manifest = "workspace = { members = ['crates/*'], resolver = '3' }\n".to_owned();
    for name in PUBLISHED {
        let folder = format!("{name}-{}", env!("CARGO_PKG_VERSION"));
        manifest += &format!("patch.crates-io.{name}.path = 'crates/{folder}'\n");
        // With the present time, by which cargo notices changes.
        run(Command::new("tar")
            .args(["--extract", "--touch", "--directory"])
            .arg(target.join("crates"))
            .arg("--file")
            .arg(target.join(format!("package/{folder}.crate"))));
    }
    fs::write(target.join("Cargo.toml"), manifest).unwrap();
    fs::copy(workspace().join("Cargo.lock"), target.join("Cargo.lock")).unwrap();
    run(Command::new(env!("CARGO"))
        .args(["check", "--workspace", "--lib", "--offline"])
        .arg("--manifest-path")
        .arg(target.join("Cargo.toml"))
        .arg("--target-dir")
        .arg(&target));
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
        let text = fs::read_to_string(workspace().join(file)).unwrap();
        assert!(
            text.lines().any(|line| line == stated),
            "{file} does not state '{stated}'"
        );
    }
}

//! Passes the Git revision of the build to the program, so that a sweep can refuse to mix two revisions.
//!
//! The revision is updated whenever a source changes, but not when a commit changes no source: a program built before its
//! commit stays `…-changed`, and is not rebuilt for every commit.

use std::process::Command;

fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().to_owned())
}

/// The sources that a sweep's rows can depend on, as Git knows them from any folder of the repository.
const SOURCES: [&str; 4] = [
    ":(top)shared/src",
    ":(top)firmware/src",
    ":(top,glob)sil-host/**/src/**",
    ":(top)Cargo.lock",
];

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    let ask = |command: &[&str]| git(&[command, &["--"], &SOURCES].concat());
    for source in ask(&["ls-files"]).iter().flat_map(|files| files.lines()) {
        println!("cargo:rerun-if-changed={source}");
    }
    let revision = match git(&["rev-parse", "--short=12", "HEAD"]) {
        None => "unknown".to_owned(),
        Some(revision) => match ask(&["status", "--porcelain", "--untracked-files=no"]) {
            Some(changes) if changes.is_empty() => revision,
            _ => format!("{revision}-changed"),
        },
    };
    println!("cargo:rustc-env=PAINLEVE_REVISION={revision}");
}

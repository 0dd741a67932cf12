//! Passes the Git revision of the build to the program, so that a sweep can refuse to mix two revisions.
//!
//! The revision is updated whenever a source changes, but not when a commit changes no source: a
//! program built
//! before its commit stays `…-changed`, and is not rebuilt for every commit.

use std::process::Command;

fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().to_owned())
}

/// Every source that a sweep's rows can depend on.
fn sources() -> Vec<String> {
    let mut sources: Vec<String> = ["../../shared/src", "../../firmware/src", "../../Cargo.lock"]
        .map(String::from)
        .into();
    let crates = std::fs::read_dir("..").into_iter().flatten().flatten();
    let folders = crates.map(|folder| folder.path().join("src"));
    let folders = folders.filter(|folder| folder.is_dir());
    sources.extend(folders.map(|folder| folder.to_string_lossy().into_owned()));
    sources.sort();
    sources
}

fn main() {
    let sources = sources();
    for source in &sources {
        println!("cargo:rerun-if-changed={source}");
    }
    let mut status = vec!["status", "--porcelain", "--untracked-files=no", "--"];
    status.extend(sources.iter().map(String::as_str));
    let revision = match git(&["rev-parse", "--short=12", "HEAD"]) {
        None => "unknown".to_owned(),
        Some(revision) => match git(&status) {
            Some(changes) if changes.is_empty() => revision,
            _ => format!("{revision}-changed"),
        },
    };
    println!("cargo:rustc-env=PAINLEVE_REVISION={revision}");
}

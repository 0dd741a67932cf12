//! Tells the program from which revision it is built, so that a sweep can refuse to mix two.
//!
//! Told again whenever a source changes, but not when a commit changes nothing: a program built
//! before its commit stays `…-changed`, and is not built again for every commit.

use std::process::Command;

fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().to_owned())
}

fn main() {
    let sources = ["src", "../shared/src", "../firmware/src", "../Cargo.lock"];
    for source in sources {
        println!("cargo:rerun-if-changed={source}");
    }
    let status = ["status", "--porcelain", "--untracked-files=no", "--"];
    let revision = match git(&["rev-parse", "--short=12", "HEAD"]) {
        None => "unknown".to_owned(),
        Some(revision) => match git(&[&status[..], &sources[..]].concat()) {
            Some(changes) if changes.is_empty() => revision,
            _ => format!("{revision}-changed"),
        },
    };
    println!("cargo:rustc-env=PAINLEVE_REVISION={revision}");
}

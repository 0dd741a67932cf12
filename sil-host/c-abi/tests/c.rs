//! The header matches the functions, and a C program works with both.

use std::path::{Path, PathBuf};
use std::process::Command;

fn folder() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Set `PAINLEVE_WRITE_HEADER` to write the header instead of comparing it.
#[test]
fn the_header_matches_the_functions() {
    let config = cbindgen::Config::from_file(folder().join("cbindgen.toml")).unwrap();
    let sources = ["status", "frames", "controller", "plant"];
    let mut builder = cbindgen::Builder::new().with_config(config);
    for source in sources {
        builder = builder.with_src(folder().join(format!("src/{source}.rs")));
    }
    let mut generated = Vec::new();
    builder.generate().unwrap().write(&mut generated);
    let path = folder().join("include/painleve.h");
    if std::env::var_os("PAINLEVE_WRITE_HEADER").is_some() {
        std::fs::write(&path, &generated).unwrap();
    }
    let kept = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        kept.as_bytes() == generated,
        "the header is out of date: run this test with PAINLEVE_WRITE_HEADER=1"
    );
}

#[test]
fn a_program_in_c_closes_the_loop() {
    // Cargo writes the shared library beside the tests.
    let libraries = std::env::current_exe().unwrap();
    let libraries = libraries.parent().unwrap();
    let example = folder().join("../../examples/c/closed_loop.c");
    let program: PathBuf = Path::new(env!("CARGO_TARGET_TMPDIR")).join("closed_loop");
    let compiled = Command::new("cc")
        .args([
            "-std=c99",
            "-Wall",
            "-Wextra",
            "-Wpedantic",
            "-Werror",
            "-o",
        ])
        .arg(&program)
        .arg(&example)
        .arg("-I")
        .arg(folder().join("include"))
        .arg("-L")
        .arg(libraries)
        .arg(format!("-Wl,-rpath,{}", libraries.display()))
        .args(["-lpainleve_c", "-lm"])
        .status()
        .unwrap();
    assert!(compiled.success());
    let output = Command::new(&program).output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{said}{output:?}");
    assert!(
        said.contains("refused: ") && said.contains("belt.friction"),
        "{said}"
    );
    assert!(said.contains("tip at 0.14"), "{said}");
}

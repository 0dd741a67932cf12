//! The header matches the functions, and programs in C and C++ work with both.

#![allow(clippy::unwrap_used)]

use std::path::Path;
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

/// Compiles an example with this command, links it with the shared library, runs it, and returns its
/// standard output.
fn run_example(compiler: &[&str], source: &str) -> String {
    // Cargo writes the shared library beside the tests.
    let libraries = std::env::current_exe().unwrap();
    let libraries = libraries.parent().unwrap();
    let example = folder().join("../../examples").join(source);
    let program = Path::new(env!("CARGO_TARGET_TMPDIR")).join(example.file_stem().unwrap());
    let compiled = Command::new(compiler[0])
        .args(&compiler[1..])
        .args(["-Wall", "-Wextra", "-Wpedantic", "-Werror", "-o"])
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
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{said}{output:?}");
    said
}

#[test]
fn a_program_in_c_closes_the_loop() {
    let said = run_example(&["cc", "-std=c99"], "c/closed_loop.c");
    assert!(
        said.contains("refused: ") && said.contains("belt.friction"),
        "{said}"
    );
    assert!(said.contains("tip at 0.14"), "{said}");
}

#[test]
fn a_controller_in_cpp_keeps_the_tip_on_the_belt() {
    if Command::new("c++").arg("--version").output().is_err() {
        return painleve_tests::skipped("no C++ compiler");
    }
    let said = run_example(&["c++", "-std=c++17"], "cpp/own_controller.cpp");
    assert!(said.contains("highest gap"), "{said}");
}

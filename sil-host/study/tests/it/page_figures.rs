//! Figures of the pages show what this build computes, or what its benchmark has measured.

#![allow(
    clippy::unwrap_used,
    reason = "a figure that cannot be read fails its test"
)]

use std::fs;
use std::path::{Path, PathBuf};

#[expect(dead_code, reason = "only the benchmark writes the settings")]
#[path = "../../benches/work_precision/figure.rs"]
mod work_precision;

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Compares a figure of the pages, or draws it if `UPDATE_DOCUMENTATION` is set.
fn check(name: &str, expected: &str) {
    let path = workspace().join("docs/images").join(name);
    if std::env::var_os("UPDATE_DOCUMENTATION").is_some() {
        fs::write(&path, expected).unwrap();
    }
    let present = fs::read_to_string(&path).unwrap();
    assert!(
        present == expected,
        "docs/images/{name} is not up to date: run this test with UPDATE_DOCUMENTATION=1"
    );
}

/// `cargo xtask measure figures` draws it by the command.
fn check_study(name: &str) {
    let entry = painleve_study::find(name).unwrap();
    let parser = entry.command().no_binary_name(true);
    let matches = parser.try_get_matches_from([""; 0]).unwrap();
    let study = (entry.read)(&matches).unwrap().study().unwrap();
    check(
        &format!("{name}.svg"),
        &study.compute(&|| ()).unwrap().svg(),
    );
}

#[test]
#[ignore = "computes a study"]
fn the_figure_of_the_stiffness_is_computed_by_this_build() {
    check_study("stiffness");
}

#[test]
#[ignore = "computes a study"]
fn the_figure_of_the_ringing_is_computed_by_this_build() {
    check_study("ringing");
}

#[test]
fn the_figure_of_error_against_cost_shows_the_measured_rows() {
    let results = workspace().join("benches/work_precision/results.csv");
    let panels = work_precision::PANELS.iter();
    let rows = panels.flat_map(|(ticks, _)| work_precision::kept(*ticks, &results).unwrap());
    let rows: Vec<_> = rows.collect();
    check("work-precision.svg", &work_precision::svg(&rows));
}

//! Checks that the generated parts of the documentation are up to date.
//!
//! A part begins with `<!-- generated: NAME -->` and ends with `<!-- end -->`.

#![allow(clippy::unwrap_used)]

use std::fmt::Write;
use std::path::PathBuf;

use painleve_plant::scenario::describe::settings_table;
use painleve_shared::frame::StatusFlags;
use painleve_shared::lapse::Lapse;
use painleve_shared::status::Fault;

/// The sections of a scenario that do not belong to the controller.
const SECTIONS: [&str; 10] = [
    "run",
    "arm",
    "arm_model",
    "belt",
    "impact",
    "contact",
    "effects",
    "solver",
    "initial",
    "converters",
];

fn faults() -> String {
    let mut text = "| number | fault | meaning | limit |\n|---|---|---|---|\n".to_string();
    for fault in Fault::ALL {
        let limits: Vec<_> = Lapse::ALL
            .iter()
            .filter(|lapse| lapse.fault() == *fault)
            .map(|lapse| format!("`lapses.{}`", lapse.key()))
            .collect();
        let (number, meaning, limits) = (*fault as u8, fault.description(), limits.join(", "));
        writeln!(text, "| {number} | `{fault:?}` | {meaning} | {limits} |").unwrap();
    }
    text
}

/// Compares a part of a page with its expected text, or writes it if `UPDATE_DOCUMENTATION` is set.
fn check(page: &str, name: &str, expected: &str) {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../../docs")
        .join(page);
    let text = std::fs::read_to_string(&path).unwrap();
    let begin = format!("<!-- generated: {name} -->\n");
    let (before, rest) = text.split_once(&begin).expect(&begin);
    let (present, after) = rest.split_once("<!-- end -->").expect("<!-- end -->");
    let expected = format!("\n{expected}\n");
    if present == expected {
        return;
    }
    if std::env::var_os("UPDATE_DOCUMENTATION").is_some() {
        let text = format!("{before}{begin}{expected}<!-- end -->{after}");
        std::fs::write(&path, text).unwrap();
        return;
    }
    panic!(
        "docs/{page}: the part '{name}' is not up to date; update it with:\n\
         UPDATE_DOCUMENTATION=1 cargo test -p painleve-plant --test documentation"
    );
}

/// One test for all parts, so that two parts of one page are not written at the same time.
#[test]
fn generated_parts_are_up_to_date() {
    check(
        "controller.md",
        "settings",
        &settings_table(&["controller"]),
    );
    check("controller.md", "faults", &faults());
    check("scenarios.md", "settings", &settings_table(&SECTIONS));
}

#[test]
fn every_status_flag_is_documented() {
    use painleve_shared::frame::bitflags::Flags;
    let page = include_str!("../../../docs/controller.md");
    for flag in StatusFlags::FLAGS {
        let bit = flag.value().bits().trailing_zeros();
        let row = format!("| {bit} | `{}` |", flag.name());
        assert!(page.contains(&row), "no row {row}");
    }
}

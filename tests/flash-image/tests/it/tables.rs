//! The tables of hazards and of the models' assumptions name tests that exist, each hazard one on both boards.

#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::Path;

/// Pages and headings of the sections with these tables.
const SECTIONS: [(&str, &str); 3] = [
    ("docs/flashing.md", "## Hazards"),
    ("docs/flashing.md", "### What takes longer than two ticks"),
    (
        "sil-host/chips/README.md",
        "# What the models of the chips assume",
    ),
];

/// Returns the sources of all tests in a folder.
fn sources(folder: &Path) -> String {
    let mut text = String::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            text += &sources(&path);
        } else {
            text += &fs::read_to_string(path).unwrap();
        }
    }
    text
}

/// Returns the tests that a row names in its last column; one that ends in an ellipsis by its beginning.
fn named(row: &str) -> Vec<String> {
    let last = row.trim_end_matches([' ', '|']).rsplit('|').next();
    let words = last.unwrap_or_default().split('`').skip(1).step_by(2);
    words
        .filter(|it| !it.ends_with(".rs"))
        .map(|it| it.trim_end_matches('…').to_owned())
        .collect()
}

/// Returns whether a test is executed on both boards.
fn is_on_both(tests: &str, name: &str) -> bool {
    let is_listed = |line: &str| line.trim_start().starts_with(name) && line.ends_with(',');
    let begin = format!("\nfn {name}");
    let bodies = tests.split(&begin).skip(1);
    let mut bodies = bodies.filter_map(|it| it.split("\n}\n").next());
    tests.lines().any(is_listed) || bodies.any(|it| it.contains("G474"))
}

#[test]
fn every_test_that_the_tables_name_exists() {
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut tests = sources(&workspace.join("tests/flash-image/tests"));
    tests += &sources(&workspace.join("sil-host/chips/tests"));
    let mut count = 0;
    for (page, heading) in SECTIONS {
        let page = fs::read_to_string(workspace.join(page)).unwrap();
        let section = page.split(&format!("{heading}\n")).nth(1).unwrap();
        let section = section.split("\n#").next().unwrap();
        for row in section.lines().filter(|it| it.starts_with("| ")) {
            let names = named(row);
            let names = || names.iter().filter(|it| it.contains('_'));
            for name in names() {
                assert!(tests.contains(&format!("fn {name}")), "{name}: {row}");
                count += 1;
            }
            let is_hazard = heading == "## Hazards" && !row.starts_with("| failure |");
            assert!(
                !is_hazard || names().any(|it| is_on_both(&tests, it)),
                "no test on both boards: {row}"
            );
        }
    }
    assert!(count > 60, "{count}");
}

//! The commands that the page of figures prints reproduce the rows of its sections.

#![allow(clippy::unwrap_used)]

use painleve_study::STUDIES;
use painleve_study_core::figures::page_maker::{Fineness, PageMaker};

/// Returns the CSV rows that a printed command computes, header first.
fn rows(command: &str) -> Vec<String> {
    let words: Vec<&str> = command.split_whitespace().collect();
    let ["painleve", "study", name, options @ ..] = words.as_slice() else {
        panic!("{command} is not a study");
    };
    let entry = painleve_study::find(name).unwrap();
    let parser = entry.command().no_binary_name(true);
    let matches = parser.try_get_matches_from(options).unwrap();
    let study = (entry.read)(&matches).unwrap().study().unwrap();
    lines(&study.compute(&|| ()).unwrap().csv().unwrap())
}

fn lines(csv: &[u8]) -> Vec<String> {
    let text = std::str::from_utf8(csv).unwrap();
    text.lines().map(ToOwned::to_owned).collect()
}

#[test]
#[ignore = "executes every command of the pages"]
fn every_printed_command_reproduces_the_rows_of_its_section() {
    // Equal rows require equal arguments, not long runs.
    let short = Fineness {
        open_loop_s: [1.0, 0.5],
        closed_loop_s: [0.4, 0.2],
        sliding_range_m: [0.2, 0.1],
        ..Fineness::DRAFT
    };
    let page = PageMaker {
        fineness: &short,
        progress: &|_, _| Box::new(|| ()),
    };
    let mut sections = 0;
    for study in &STUDIES {
        for (section, outcome) in (study.sections)(&page).unwrap() {
            let mut found: Vec<String> = Vec::new();
            for command in &section.commands {
                let rows = rows(command);
                let header = usize::from(!found.is_empty());
                found.extend(rows.into_iter().skip(header));
            }
            assert_eq!(found, lines(&outcome.csv().unwrap()), "{}", section.name);
            sections += 1;
        }
    }
    assert!(sections > 5);
}

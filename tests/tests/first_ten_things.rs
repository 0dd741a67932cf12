//! The commands of the page "First ten things" work as printed.

use std::path::Path;

use painleve_tests::{Bench, code, errors};

/// Returns the commands of the blocks marked `sh`, with their words.
fn commands(page: &str) -> Vec<Vec<&str>> {
    let blocks = page.split("```sh\n").skip(1);
    let blocks = blocks.filter_map(|block| block.split("```").next());
    let lines = blocks.flat_map(str::lines);
    lines
        .map(|line| line.split_whitespace().collect())
        .collect()
}

#[test]
fn every_command_for_the_program_alone_succeeds_and_writes_its_files() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/first-ten-things.md");
    let page = std::fs::read_to_string(page).unwrap();
    let bench = Bench::new("first-ten-things");
    let commands = commands(&page);
    assert!(commands.len() >= 7, "{commands:?}");
    for words in commands {
        let ["painleve", arguments @ ..] = words.as_slice() else {
            panic!("{words:?} is not a command of this program");
        };
        let output = bench.run(arguments);
        assert_eq!(code(output.status), 0, "{words:?}: {}", errors(&output));
        for file in words.iter().filter(|word| word.starts_with("out/")) {
            assert!(bench.path(file).exists(), "{words:?} did not write {file}");
        }
    }
}

//! The page "First ten things" works as printed: its commands, the schemas of its record, its Python.

#![allow(clippy::unwrap_used)]

use std::collections::BTreeMap;
use std::process::Command;

use boon::{Compiler, Schemas};
use painleve_tests::python::{python, workspace};
use painleve_tests::{Bench, code, errors, image};

/// Returns the page.
fn page() -> String {
    std::fs::read_to_string(workspace().join("docs/first-ten-things.md")).unwrap_or_default()
}

/// Returns the blocks in a language.
fn blocks<'a>(page: &'a str, language: &str) -> Vec<&'a str> {
    let start = format!("```{language}\n");
    let blocks = page.match_indices(&start);
    blocks
        .filter_map(|(at, _)| page[at + start.len()..].split("```").next())
        .collect()
}

/// Returns the commands of the blocks marked `sh`, with their words.
fn commands(page: &str) -> Vec<Vec<&str>> {
    let lines = blocks(page, "sh").into_iter().flat_map(str::lines);
    lines
        .map(|line| line.split_whitespace().collect())
        .collect()
}

/// Returns the commands that contain a word.
fn commands_with<'a>(page: &'a str, word: &str) -> Vec<Vec<&'a str>> {
    let mut commands = commands(page);
    commands.retain(|words| words.iter().any(|one| one.contains(word)));
    commands
}

/// Executes commands.
fn execute(bench: &Bench, commands: &[Vec<&str>]) {
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

#[test]
fn every_command_for_the_program_alone_succeeds_and_its_files_are_what_the_page_says() {
    image();
    let page = page();
    let bench = Bench::new("first-ten-things");
    let commands = commands(&page);
    assert!(commands.len() >= 7);
    execute(&bench, &commands);
    a_boards_record_holds_the_same_numbers_as_the_simulated_one(&bench, &page);
    foxglove_can_read_every_message(&std::fs::read(bench.path("out/capture.mcap")).unwrap());
}

fn a_boards_record_holds_the_same_numbers_as_the_simulated_one(bench: &Bench, page: &str) {
    let tables = ["board", "simulated"].map(|name| {
        let record = format!("out/{name}.mcap");
        assert_eq!(commands_with(page, &record).len(), 1);
        bench.report(&["export", &record, "--csv", "--json"]);
        std::fs::read(bench.path(&format!("out/{name}.csv"))).unwrap()
    });
    assert!(tables[0].len() > 1_000_000);
    assert!(tables[0] == tables[1]);
}

fn foxglove_can_read_every_message(record: &[u8]) {
    let mut schemas = Schemas::new();
    let mut compiler = Compiler::new();
    let mut known = BTreeMap::new();
    for message in mcap::MessageStream::new(record).unwrap() {
        let message = message.unwrap();
        let topic = message.channel.topic.clone();
        let schema = *known.entry(topic.clone()).or_insert_with(|| {
            let schema = message.channel.schema.as_ref().unwrap();
            let json = serde_json::from_slice(&schema.data).unwrap();
            compiler.add_resource(&topic, json).unwrap();
            compiler.compile(&topic, &mut schemas).unwrap()
        });
        let json = serde_json::from_slice(&message.data).unwrap();
        if let Err(error) = schemas.validate(&json, schema) {
            panic!("{topic} at {}: {error}", message.log_time);
        }
    }
    let topics = [
        "/actuator",
        "/estimates",
        "/events",
        "/plant",
        "/scene",
        "/sensor",
        "/tf",
    ];
    assert_eq!(known.keys().collect::<Vec<_>>(), topics);
}

#[test]
#[ignore = "needs Python packages of the network"]
fn pandas_reads_and_plots_a_run() {
    let Some(python) = python("pandas", &["pandas", "matplotlib"]) else {
        return;
    };
    let page = page();
    let bench = Bench::new("first-ten-things-pandas");
    let commands = commands_with(&page, "out/run.csv");
    assert_eq!(commands.len(), 1);
    execute(&bench, &commands);
    let recording = std::fs::read_to_string(workspace().join("docs/recording.md")).unwrap();
    let snippet = [blocks(&page, "python"), blocks(&recording, "python")].concat();
    assert_eq!(snippet.len(), 2);
    let snippet = snippet.concat();
    let check = "assert len(run) == 6000 and abs(run['plant.tip_t_m'].iloc[-1] - 0.148) < 1e-3";
    let output = Command::new(python)
        .args(["-c", &format!("{snippet}\n{check}\n")])
        .current_dir(bench.path("."))
        .env("MPLBACKEND", "svg")
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", errors(&output));
}

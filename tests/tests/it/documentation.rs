//! What the documentation says about files and commands is what the program does: topics of a record,
//! keys of the report, commands of the tutorials.

#![allow(
    clippy::unwrap_used,
    reason = "a page or a file that cannot be read fails its test"
)]

use std::collections::BTreeSet;
use std::fs;
use std::os::unix::fs::symlink;

use painleve_tests::python::workspace;
use painleve_tests::{Bench, code, errors, program};

fn page(name: &str) -> String {
    fs::read_to_string(workspace().join("docs").join(name)).unwrap()
}

/// Returns the cells of the table below a heading of a page.
fn table(page: &str, heading: &str) -> Vec<Vec<String>> {
    let (_, section) = page.split_once(&format!("\n## {heading}\n")).unwrap();
    let section = section.split("\n## ").next().unwrap();
    let rows = section.lines().filter(|line| line.starts_with('|')).skip(2);
    rows.map(|row| {
        let cells = row.trim_matches('|').split('|');
        cells.map(|cell| cell.trim().to_owned()).collect()
    })
    .collect()
}

/// Returns the words in backticks.
fn code_words(text: &str) -> impl Iterator<Item = String> {
    text.split('`').skip(1).step_by(2).map(str::to_owned)
}

#[test]
fn the_record_has_the_documented_topics_and_schemas() {
    let bench = Bench::new("documented-topics");
    bench.report(&["run", "capture", "--json", "--no-plot"]);
    let bytes = fs::read(bench.path("out/run.mcap")).unwrap();
    let written: BTreeSet<_> = mcap::MessageStream::new(&bytes)
        .unwrap()
        .map(|message| {
            let channel = message.unwrap().channel.clone();
            let schema = channel.schema.as_ref().unwrap().name.clone();
            (channel.topic.clone(), schema)
        })
        .collect();
    let documented: BTreeSet<_> = table(&page("recording.md"), "Topics")
        .iter()
        .map(|row| {
            let [topic, schema] = [&row[0], &row[2]].map(|cell| code_words(cell).next().unwrap());
            (topic, schema)
        })
        .collect();
    assert_eq!(written, documented);
}

#[test]
fn the_report_has_the_documented_keys() {
    let bench = Bench::new("documented-keys");
    let report = bench.report(&["run", "--json", "--no-plot", "--no-record"]);
    let written: BTreeSet<_> = report.as_object().unwrap().keys().cloned().collect();
    let rows = table(&page("recording.md"), "Report as JSON");
    let documented: BTreeSet<_> = rows.iter().flat_map(|row| code_words(&row[0])).collect();
    assert_eq!(written, documented);
}

#[test]
#[ignore = "executes every command of the tutorials"]
fn the_commands_of_the_tutorials_succeed() {
    let bench = Bench::new("tutorials");
    symlink(workspace().join("examples"), bench.path("examples")).unwrap();
    let page = page("tutorials.md");
    let mut executed = 0;
    let blocks = page.split("```").skip(1).step_by(2);
    // Those in another language say so.
    let commands = blocks.filter(|block| block.starts_with('\n'));
    for line in commands.flat_map(str::lines) {
        let command = line.split(" #").next().unwrap().trim();
        let is_elsewhere = command.is_empty()
            // Builds and hardware: tested by `cargo xtask test` or not at all.
            || command.starts_with("cargo ")
            || ["--host qemu", "--host serial"].iter().any(|host| command.contains(host));
        if is_elsewhere {
            continue;
        }
        let path = program().parent().unwrap().display();
        let output = std::process::Command::new("sh")
            .args(["-ec", command])
            .current_dir(bench.path("."))
            .env("PATH", format!("{path}:{}", env!("PATH")))
            .output()
            .unwrap();
        assert_eq!(code(output.status), 0, "{command}: {}", errors(&output));
        executed += 1;
    }
    assert!(executed >= 10, "only {executed} commands found");
    for file in [
        "out/run.html",
        "out/my-arm.html",
        "out/rehearsed/identified.toml",
    ] {
        assert!(bench.path(file).exists(), "{file}");
    }
}

#[test]
fn commissioning_prints_json() {
    let bench = Bench::new("commission-json");
    let arguments = [
        "commission",
        "--rehearse",
        "--mistake",
        "first-encoder-mirrored",
    ];
    let found = bench.report(&[&arguments[..], &["--json"]].concat());
    let keys: Vec<_> = found.as_object().unwrap().keys().collect();
    let documented = ["corrections", "friction", "output"];
    assert_eq!(keys, documented);
    assert_eq!(found["corrections"].as_array().unwrap().len(), 1, "{found}");
    assert!(bench.path(found["output"].as_str().unwrap()).exists());
}

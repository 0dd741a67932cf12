//! `painleve tune`: a search that goes on where it ended, and says whether it helps.

#![allow(clippy::unwrap_used)]

use std::time::{Duration, Instant};

use nix::sys::signal::Signal;
use painleve_tests::{Bench, code, errors, is_running, signal};
use serde_json::Value;

const KEYS: [&str; 5] = [
    "tune",
    "off.toml",
    "--json",
    "--key",
    "controller.law.hybrid.velocity_gain_per_s=20:300",
];
const OFF: &str = "[run]\nduration_s = 1.0\n[controller]\nreference = [{ minimum-jerk = { target_m = 0.0, duration_s = 0.7 } }]\n\
    [controller.law.hybrid]\nvelocity_gain_per_s = 250.0\n";

fn tune(bench: &Bench, trials: &str) -> Value {
    bench.report(&[&KEYS[..], &["--cases", "1", "--trials", trials]].concat())
}

#[test]
fn a_search_is_continued_and_its_result_can_be_run() {
    let bench = Bench::new("tune");
    std::fs::write(bench.path("off.toml"), OFF).unwrap();
    let found = tune(&bench, "16");
    assert!(found["cost"].as_f64().unwrap() < 1.0, "{found}");
    let gain = &found["values"]["controller.law.hybrid.velocity_gain_per_s"];
    let tuned = bench.report(&["diff", "off.toml", "out/tuned.toml", "--json"]);
    assert_eq!(tuned["differences"].as_array().unwrap().len(), 1, "{tuned}");
    let written: f64 = tuned["differences"][0]["second"]
        .as_str()
        .unwrap()
        .parse()
        .unwrap();
    assert!(
        (written / gain.as_f64().unwrap() - 1.0).abs() < 1e-6,
        "{tuned}"
    );
    // Cut off in the middle: it goes on, and ends with the same.
    let table = std::fs::read_to_string(bench.path("out/tune.csv")).unwrap();
    let lines: Vec<&str> = table.lines().collect();
    assert_eq!(lines.len(), 17);
    std::fs::write(bench.path("out/tune.csv"), lines[..9].join("\n") + "\n").unwrap();
    assert_eq!(tune(&bench, "16"), found);
    assert_eq!(
        std::fs::read_to_string(bench.path("out/tune.csv")).unwrap(),
        table
    );
    // More trials continue it, too.
    tune(&bench, "24");
    let longer = std::fs::read_to_string(bench.path("out/tune.csv")).unwrap();
    assert!(longer.starts_with(&table), "{longer}");

    let foreign = bench.run(
        &[
            &KEYS[..],
            &["--cases", "1", "--trials", "16", "--seed", "9"],
        ]
        .concat(),
    );
    assert_eq!(code(foreign.status), 2);
    assert!(
        errors(&foreign).contains("out/tune.csv is not a table of this search"),
        "{}",
        errors(&foreign)
    );
    let wrong = bench.run(&["tune", "edge", "--key", "belt.frction=0.1:1"]);
    assert_eq!(code(wrong.status), 2);
    assert!(
        errors(&wrong).contains("did you mean 'friction'?"),
        "{}",
        errors(&wrong)
    );
}

#[test]
fn a_table_of_another_search_is_refused_and_kept() {
    let bench = Bench::new("tune-foreign");
    std::fs::write(bench.path("off.toml"), OFF).unwrap();
    tune(&bench, "8");
    let path = bench.path("out/tune.csv");
    let table = std::fs::read_to_string(&path).unwrap();
    let (header, rows) = table.split_once('\n').unwrap();
    let (first, rows) = rows.split_once('\n').unwrap();
    let (scores, _) = first.rsplit_once(',').unwrap();
    let (value, _) = first.split_once(',').unwrap();
    for (changed, part) in [
        (
            "one line\n".to_owned(),
            "its first line is not 'controller.",
        ),
        (table.replace("velocity", "position"), "its first line"),
        (
            format!("{header}\n{scores},-1000.0\n{rows}"),
            "line 2: cost = -1000.0, but in this search",
        ),
        (
            table.replacen(value, "1.0", 1),
            "velocity_gain_per_s = 1.0 is not a number from 20 to 300",
        ),
        (
            format!("{header}\n{value},2,1,1,1,1\n{rows}"),
            "line 2: kept = 2 is not a number from 0 to 1",
        ),
    ] {
        std::fs::write(&path, &changed).unwrap();
        let output = bench.run(&[&KEYS[..], &["--cases", "1", "--trials", "8"]].concat());
        assert_eq!(code(output.status), 2, "{output:?}");
        assert!(errors(&output).contains(part), "{output:?}");
        assert_eq!(std::fs::read_to_string(&path).unwrap(), changed);
    }
    let twice = bench.run(&[&KEYS[..], &KEYS[3..]].concat());
    assert_eq!(code(twice.status), 2, "{twice:?}");
    assert!(errors(&twice).contains("is given twice"), "{twice:?}");
}

#[test]
fn one_search_at_a_time_has_a_table_and_an_interrupted_one_leaves_it_whole() {
    let bench = Bench::new("tune-twice");
    std::fs::write(bench.path("off.toml"), OFF).unwrap();
    let first = bench.start(&[&KEYS[..], &["--trials", "100000"]].concat());
    let start = Instant::now();
    while !bench.path("out/tune.csv").exists() {
        let is_patient = start.elapsed() < Duration::from_secs(20);
        assert!(is_patient && is_running(first.id()), "no table");
        std::thread::sleep(Duration::from_millis(10));
    }
    let second = bench.run(&KEYS);
    assert_eq!(code(second.status), 4, "{second:?}");
    let message = errors(&second);
    assert!(
        message.contains("is being written by another process"),
        "{message}"
    );
    signal(first.id(), Signal::SIGTERM);
    let (output, _) = first.end(Duration::from_secs(10));
    assert_eq!(code(output.status), 130, "{output:?}");
    assert_eq!(errors(&output), "error: interrupted\n");
    assert_eq!(bench.files(), ["off.toml", "out/tune.csv"]);
}

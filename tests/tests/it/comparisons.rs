//! `painleve compare` and `painleve diff`, and starts given as a place of the tip.

#![allow(clippy::unwrap_used)]

use painleve_tests::{Bench, code, errors};
use serde_json::{Value, json};

/// Runs a scenario and keeps its record.
fn record(bench: &Bench, name: &str, set: &[&str]) {
    let file = format!("{name}.mcap");
    let mut words = vec!["run", "edge", "--json", "--no-plot", "--record", &file];
    words.extend(["--set", "run.duration_s=1.5"]);
    words.extend(set.iter().flat_map(|set| ["--set", set]));
    bench.report(&words);
}

fn compare(bench: &Bench, words: &[&str]) -> Value {
    bench.report(&[&["compare", "--json"], words].concat())
}

fn refusal(bench: &Bench, words: &[&str]) -> String {
    let output = bench.run(words);
    assert_eq!(code(output.status), 2, "{words:?}");
    errors(&output)
}

#[test]
fn runs_are_compared_from_the_event_on() {
    let bench = Bench::new("compare");
    record(&bench, "a", &[]);
    record(&bench, "late", &["run.enable_at_s=0.25"]);
    record(&bench, "slippery", &["belt.friction=0.3"]);
    bench.report(&["export", "slippery.mcap", "--csv", "--json"]);

    let same = compare(&bench, &["a.mcap", "a.mcap"]);
    let differences = same["differences"].as_array().unwrap();
    assert!(differences.len() >= 6, "{same}");
    assert!(
        differences.iter().all(|one| one["largest"] == 0.0),
        "{same}"
    );

    let found = compare(&bench, &["a.mcap", "late.mcap", "slippery.csv"]);
    let starts: Vec<_> = found["outcomes"]
        .as_array()
        .unwrap()
        .iter()
        .map(|one| &one["event_s"])
        .collect();
    assert_eq!(starts, [&json!(0.0), &json!(0.25), &json!(0.0)]);
    let rms = |run: &str, quantity: &str| {
        let differences = found["differences"].as_array().unwrap();
        let one = differences
            .iter()
            .find(|one| one["run"] == run && one["quantity"] == quantity);
        one.unwrap()["rms"].as_f64().unwrap()
    };
    assert!(rms("slippery.csv", "friction") > 0.05, "{found}");

    let page = std::fs::read_to_string(bench.path("out/compare.html")).unwrap();
    for part in ["slippery.csv", "run.enable_at_s", "Settings that differ"] {
        assert!(page.contains(part), "{part}");
    }
    let figure = std::fs::read_to_string(bench.path("out/compare.svg")).unwrap();
    assert!(figure.contains("late.mcap") && figure.contains("Time after ENABLE"));

    // The arm that has moved on its own for a quarter of a second follows the same reference from there.
    let unaligned = compare(&bench, &["a.mcap", "late.mcap", "--align", "start"]);
    let unaligned_mm = unaligned["differences"][0]["rms"].as_f64().unwrap();
    assert!(
        rms("late.mcap", "tip_mm") < 0.6 * unaligned_mm,
        "{found} {unaligned}"
    );
}

#[test]
fn what_cannot_be_compared_is_named() {
    let bench = Bench::new("compare-refused");
    record(&bench, "a", &[]);
    record(&bench, "never", &["run.enable_at_s=100"]);
    bench.report(&["export", "a.mcap", "--csv", "--json"]);
    std::fs::write(bench.path("other.csv"), "a,b\n1,2\n").unwrap();
    let whole = std::fs::read(bench.path("a.mcap")).unwrap();
    std::fs::write(bench.path("cut.mcap"), &whole[..whole.len() / 2]).unwrap();
    for (words, part) in [
        (
            &["compare", "a.mcap", "never.mcap"][..],
            "never.mcap: ENABLE does not happen in it",
        ),
        (
            &["compare", "a.csv", "a.mcap"],
            "the first run must be a record",
        ),
        (&["compare", "a.mcap", "other.csv"], "no column time_s"),
        (&["compare", "a.mcap", "missing.mcap"], "missing.mcap"),
        (
            &["compare", "a.mcap", "cut.mcap"],
            "painleve export --csv --recover exports the ",
        ),
        (
            &["compare", "a.mcap", "a.csv", "--html", "a.csv"],
            "would replace",
        ),
        (&["diff", "edge", "edgee"], "did you mean 'edge'?"),
        (&["diff", "edge", "missing.mcap"], "missing.mcap"),
    ] {
        let message = refusal(&bench, words);
        assert!(message.contains(part), "{words:?}: {message}");
        assert_eq!(message.lines().count(), 1, "{message}");
    }
    assert!(!bench.path("out/compare.html").exists());
    assert_eq!(code(bench.run(&["compare", "a.mcap"]).status), 2);
}

#[test]
fn differences_between_scenarios_and_records_are_listed() {
    let bench = Bench::new("diff");
    record(&bench, "a", &["belt.friction=0.35"]);
    let found = bench.report(&["diff", "edge", "a.mcap", "--json"]);
    let keys = json!([
        { "key": "belt.friction", "first": "0.6", "second": "0.35" },
        { "key": "run.duration_s", "first": "6.0", "second": "1.5" },
    ]);
    assert_eq!(found["differences"], keys);
    let none = bench.run(&["diff", "edge", "edge"]);
    assert_eq!(String::from_utf8_lossy(&none.stdout), "no key differs\n");
}

#[test]
fn a_scenario_without_its_defaults_is_the_same_scenario() {
    let bench = Bench::new("brief");
    let brief = bench.run(&["scenarios", "edge", "--diff"]).stdout;
    assert!(brief.iter().filter(|byte| **byte == b'\n').count() < 15);
    std::fs::write(bench.path("brief.toml"), brief).unwrap();
    let found = bench.report(&["diff", "edge", "brief.toml", "--json"]);
    assert_eq!(found["differences"], json!([]));
}

#[test]
fn a_run_starts_with_the_tip_where_the_scenario_says() {
    let bench = Bench::new("start");
    let text = "initial = { tip_m = 0.05, elbow = \"up\" }\nrun.duration_s = 0.01\n";
    std::fs::write(bench.path("mine.toml"), text).unwrap();
    bench.report(&[
        "run",
        "mine.toml",
        "--json",
        "--no-plot",
        "--no-record",
        "--csv",
        "run.csv",
    ]);
    let table = std::fs::read_to_string(bench.path("run.csv")).unwrap();
    let mut lines = table
        .lines()
        .map(|line| line.split(',').collect::<Vec<_>>());
    let (header, first) = (lines.next().unwrap(), lines.next().unwrap());
    let value = |name: &str| -> f64 {
        let column = header.iter().position(|column| *column == name).unwrap();
        first[column].parse().unwrap()
    };
    assert!((value("plant.tip_t_m") - 0.05).abs() < 1e-9);
    assert!(value("plant.gap_m").abs() < 1e-9);
    assert!(value("plant.theta2_rad") > value("plant.theta1_rad"));

    std::fs::write(bench.path("far.toml"), "initial = { tip_m = 0.3 }\n").unwrap();
    let message = refusal(&bench, &["run", "far.toml"]);
    assert!(
        message.contains("initial.tip_m = 0.3 is outside the allowed range -0.184"),
        "{message}"
    );
}

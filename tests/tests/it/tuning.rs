//! `painleve tune`: a search that goes on where it ended, and says whether it helps.

#![allow(clippy::unwrap_used)]

use painleve_tests::{Bench, code, errors};
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

//! `painleve study robustness`, `ablation`, `capture` and `lift-off` on the command line, and the
//! replay of one of their runs.

use painleve_tests::{Bench, code, errors};
use serde_json::Value;

fn number(value: &Value) -> f64 {
    value
        .as_f64()
        .unwrap_or_else(|| panic!("no number: {value}"))
}

fn list(value: &Value) -> &[Value] {
    let array = value.as_array();
    array.unwrap_or_else(|| panic!("no array: {value}"))
}

/// Checks for a single one-line message, apart from a pointer to the help, and no output.
fn is_refused(bench: &Bench, arguments: &[&str], expected: &[&str]) {
    let output = bench.run(arguments);
    let message = errors(&output);
    assert_eq!(code(output.status), 2, "{arguments:?}: {message}");
    assert_eq!(message.matches("error: ").count(), 1, "{message}");
    let first = message.lines().next().unwrap_or_default();
    for part in expected {
        assert!(first.contains(part), "'{part}' is not in: {message}");
    }
    assert!(output.stdout.is_empty(), "{output:?}");
}

#[test]
fn wrong_keys_and_values_are_named_and_nothing_is_written() {
    let bench = Bench::new("campaign-keys");
    for study in ["robustness", "ablation", "effects", "capture", "lift-off"] {
        for (wrong, expected) in [
            (
                "controller.response.enabld=true",
                &["controller.response.enabld", "did you mean 'enabled'"][..],
            ),
            (
                "converters.link.frame_loss=2",
                &["converters.link.frame_loss = 2", "0 to 1"],
            ),
            ("belt.friction", &["'belt.friction'", "key=value"]),
        ] {
            let files = ["--csv", "a.csv", "--svg", "deep/a.svg"];
            let line = [&["study", study, "--runs", "2", "--set", wrong], &files[..]].concat();
            is_refused(&bench, &line, expected);
        }
    }
    assert!(bench.files().is_empty(), "{:?}", bench.files());
}

#[test]
fn numbers_of_runs_are_from_one_to_ten_million() {
    let bench = Bench::new("campaign-runs");
    for study in ["robustness", "ablation", "effects", "capture", "lift-off"] {
        for runs in ["0", "-3", "10000001", "1.5", "many", ""] {
            let expected = [&format!("'{runs}'"), "--runs", "1 to 10000000"];
            is_refused(&bench, &["study", study, "--runs", runs], &expected);
        }
    }
    let unknown = ["study", "robustness", "--runs", "1", "--without", "brakes"];
    is_refused(&bench, &unknown, &["'brakes'", "--without"]);
    let unknown = ["study", "effects", "--runs", "1", "--effect", "rain"];
    is_refused(&bench, &unknown, &["'rain'", "--effect"]);
}

#[test]
fn files_that_cannot_be_written_are_reported_before_anything_is_computed() {
    let bench = Bench::new("campaign-unwritable");
    std::fs::write(bench.path("file"), "").unwrap_or_default();
    for study in ["robustness", "ablation", "effects", "capture", "lift-off"] {
        // With so many runs it would take hours to find out afterwards.
        let line = ["study", study, "--runs", "10000000", "--csv", "file/a.csv"];
        let output = bench.run(&line);
        assert_eq!(code(output.status), 4, "{output:?}");
        assert!(errors(&output).contains("file/a.csv"), "{output:?}");
        assert!(output.stdout.is_empty(), "{output:?}");
    }
    assert_eq!(bench.files(), ["file"]);
}

#[test]
fn a_replayed_run_ends_where_it_did_in_its_campaign() {
    let bench = Bench::new("replay");
    let off = ["--set", "controller.governor.enabled=false"];
    for changes in [&[][..], &off] {
        let campaign = "study robustness --seed 3 --runs 4 --json";
        let line: Vec<&str> = campaign.split(' ').chain(changes.iter().copied()).collect();
        let report = bench.report(&line);
        for index in [1, 3] {
            let row = &list(&report["rows"])[index];
            let replay = format!("3:{index}");
            let line = [
                "run",
                "--replay",
                &replay,
                "--no-record",
                "--no-plot",
                "--json",
            ];
            let line = [&line[..], changes].concat();
            let run = bench.report(&line);
            let apart_m = number(&run["final_tip_t_m"]) - number(&row["tip_t_m"]);
            // The difference is rounding of the last printed digit.
            assert!(apart_m.abs() < 1e-12, "{run} is not {row}");
            assert_eq!(run["tick_hz"], row["tick_hz"]);
            assert_eq!(run["fault"], row["fault"]);
        }
    }
    // Another seed gives another run.
    let [other, this] = ["4:1", "3:1"].map(|replay| {
        bench.report(&[
            "run",
            "--replay",
            replay,
            "--no-record",
            "--no-plot",
            "--json",
        ])
    });
    assert_ne!(other["final_tip_t_m"], this["final_tip_t_m"]);
    assert!(bench.leftovers().is_empty());
}

#[test]
fn an_invalid_replay_is_refused() {
    let bench = Bench::new("replay-wrong");
    for text in [
        "1",
        "",
        ":",
        "1:",
        ":1",
        "a:b",
        "1:2:3",
        "-1:2",
        "1:-2",
        "1.5:2",
        "1:99999999999999999999",
    ] {
        let expected = [
            &format!("'{text}'"),
            "--replay",
            "SEED:INDEX, for example 1:42",
        ];
        is_refused(&bench, &["run", "--replay", text], &expected);
    }
    let both = ["run", "hybrid-elbow-down", "--replay", "1:2"];
    is_refused(&bench, &both, &["--replay", "SCENARIO"]);
    let range = ["run", "--replay", "1:2", "--set", "belt.friction=-1"];
    is_refused(&bench, &range, &["belt.friction = -1", "0 to 10"]);
    assert!(bench.files().is_empty(), "{:?}", bench.files());
}

#[test]
#[ignore = "a campaign"]
fn an_ablation_has_a_line_for_each_part_and_a_column_for_each_condition() {
    let bench = Bench::new("ablation");
    let all = ["study", "ablation", "--on", "rigid,capture", "--runs", "2"];
    let output = bench.run(&all);
    assert!(output.status.success(), "{output:?}");
    let table = String::from_utf8_lossy(&output.stdout).into_owned();
    let count = |text: &str| table.lines().filter(|line| line.contains(text)).count();
    assert_eq!(count("│ without "), 1, "{table}");
    let report = bench.report(&[&all[..], &["--json"]].concat());
    let rows = list(&report["rows"]);
    let (rigid, capture) = rows.split_at(rows.len() / 2);
    assert!(rigid.len() > 10, "{report}");
    for (rows, condition) in [(rigid, "rigid"), (capture, "capture")] {
        assert_eq!(count(&format!("┆ {condition} ")), 1, "{table}");
        for (place, row) in rows.iter().enumerate() {
            let part = row["without"].as_str();
            assert_eq!(
                (part.is_none(), &row["runs"]),
                (place == 0, &Value::from(2))
            );
            assert_eq!(row["condition"], condition);
            assert_eq!(
                count(&format!("│ {} ", part.unwrap_or("none"))),
                1,
                "{table}"
            );
        }
    }
    let two = ["--without", "disturbance,governor", "--csv", "a.csv"];
    bench.report(&[&all[..], &["--json"], &two].concat());
    let csv = std::fs::read_to_string(bench.path("a.csv")).unwrap_or_default();
    let cells = csv.lines().map(|line| {
        let cells: Vec<&str> = line.split(',').take(2).collect();
        cells.join(" ")
    });
    let expected = [
        "condition without",
        "rigid ",
        "rigid disturbance",
        "rigid governor",
        "capture ",
        "capture disturbance",
        "capture governor",
    ];
    assert_eq!(cells.collect::<Vec<_>>(), expected, "{csv}");
}

#[test]
fn the_reports_of_capture_and_lift_off_keep_their_contract() {
    let bench = Bench::new("captures");
    let report = bench.report(&["study", "capture", "--runs", "4", "--json"]);
    let rows = list(&report["rows"]);
    assert_eq!(
        (rows.len(), &report["success"]["runs"]),
        (4, &Value::from(4))
    );
    let succeeds = |row: &&Value| row["success"] == true;
    let successes = rows.iter().filter(succeeds).count();
    assert_eq!(report["success"]["successes"], successes, "{report}");
    let counted = |distribution: &Value| distribution["count"].as_u64();
    assert_eq!(counted(&report["capture_s"]), Some(4), "{report}");
    for row in rows.iter().filter(succeeds) {
        assert!(number(&row["capture_s"]) <= 0.5, "{row}");
        assert!(number(&row["error_m"]) <= 1e-3, "{row}");
    }

    let line = "study lift-off --runs 4 --slide-s 0.5 --json";
    let report = bench.report(&line.split(' ').collect::<Vec<_>>());
    let of = list(&report["evidence"]);
    assert_eq!(of.len(), 2);
    for (of, (evidence, bar_s)) in of.iter().zip([("force-cell", 0.005), ("encoders", 0.01)]) {
        assert_eq!(of["evidence"], evidence);
        assert_eq!(of["bar_s"], bar_s);
        let rows = list(&report["rows"]).iter();
        let rows: Vec<&Value> = rows.filter(|row| row["evidence"] == evidence).collect();
        assert_eq!(rows.len(), 4);
        let lift_offs = rows.iter().filter(|row| !row["lift_off_s"].is_null());
        assert_eq!(of["lift_offs"], lift_offs.count(), "{report}");
        assert_eq!(of["unsolved"], 0);
    }
}

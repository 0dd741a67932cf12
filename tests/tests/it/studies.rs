//! `painleve study …` and `painleve figures` on the command line: contracts, files, mistakes.

use painleve_tests::{Bench, code, errors};
use serde_json::Value;

fn numbers(value: &Value) -> Vec<f64> {
    let array = value
        .as_array()
        .unwrap_or_else(|| panic!("no array: {value}"));
    array.iter().filter_map(Value::as_f64).collect()
}

fn keys(row: &Value, keys: &[&str]) {
    for key in keys {
        assert!(row.get(key).is_some(), "{key} is missing in {row}");
    }
}

const SLIDING: [&str; 8] = [
    "study",
    "sliding-range",
    "--controller",
    "pid,hybrid",
    "--converters",
    "hardware",
    "--scan-step-m",
    "0.1",
];

const CLOSED_LOOP: [&str; 10] = [
    "study",
    "closed-loop-bifurcation",
    "--v-belt",
    "-0.6:0.6:0.4",
    "--initial",
    "d,u,random:2",
    "--transient-s",
    "4",
    "--record-s",
    "0.5",
];

#[test]
fn table_two_keeps_its_contract_and_its_values() {
    let bench = Bench::new("admissible");
    let report = bench.report(&["study", "admissible", "--json", "--mu", "0.6"]);
    assert_eq!(report["mu"], 0.6);
    let critical = report["critical_friction"].as_f64().unwrap_or(0.0);
    assert!((critical - 0.363_96).abs() < 5e-6, "{report}");
    for (posture, expected) in [("elbow_up", 0.182_686), ("elbow_down", 0.164_705)] {
        let intervals = &report[posture]["intervals_m"];
        assert_eq!(intervals.as_array().map(Vec::len), Some(1), "{report}");
        let ends = numbers(&intervals[0]);
        assert!((ends[0] + 0.184_103).abs() < 1e-6, "{ends:?}");
        assert!((ends[1] - expected).abs() < 1e-6, "{ends:?}");
    }
    assert!(bench.files().is_empty());
}

#[test]
fn the_arm_can_be_changed_and_the_results_are_written_to_files() {
    let bench = Bench::new("changed");
    let arguments = [
        "study",
        "admissible",
        "--set",
        "arm.height_m=0.3",
        "--json",
        "--csv",
        "deep/t.csv",
        "--svg",
        "t.svg",
    ];
    let report = bench.report(&arguments);
    // The paper has no values for another arm.
    assert_eq!(report["elbow_up"]["paper_m"], Value::Null);
    assert!(numbers(&report["elbow_up"]["intervals_m"][0])[0] < -0.29);
    assert_eq!(bench.files(), ["deep/t.csv", "t.svg"]);
    let csv = std::fs::read_to_string(bench.path("deep/t.csv")).unwrap_or_default();
    assert!(csv.starts_with("mu,posture,from_m,to_m,"), "{csv}");
    let svg = std::fs::read_to_string(bench.path("t.svg")).unwrap_or_default();
    assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
}

#[test]
fn regions_have_a_number_for_every_cell_and_exact_lines() {
    let bench = Bench::new("regions");
    let arguments = [
        "study",
        "regions",
        "--theta1-deg",
        "-30:30:10",
        "--theta1-dot-rad-s",
        "-1,0,1",
        "--slip",
        "positive",
        "--csv",
        "cells.csv",
        "--json",
    ];
    let report = bench.report(&arguments);
    let maps = report["maps"].as_array().cloned().unwrap_or_default();
    assert_eq!(maps.len(), 2);
    assert_eq!(numbers(&maps[0]["p_zero_theta1_deg"]).len(), 2);
    assert_eq!(numbers(&maps[1]["p_zero_theta1_deg"]).len(), 0);
    let csv = std::fs::read_to_string(bench.path("cells.csv")).unwrap_or_default();
    assert_eq!(csv.lines().count(), 1 + 2 * 7 * 3);
    assert!(csv.contains(",inconsistent"), "{csv}");
}

#[test]
fn sliding_ranges_keep_their_contract_for_any_number_of_threads() {
    let bench = Bench::new("sliding");
    let run = |threads: &str| {
        let mut arguments = SLIDING.to_vec();
        arguments.extend([
            "--json",
            "--threads",
            threads,
            "--csv",
            threads,
            "--svg",
            "x.svg",
        ]);
        let report = bench.report(&arguments);
        let read = |name: &str| std::fs::read(bench.path(name)).unwrap_or_default();
        (report, read(threads), read("x.svg"))
    };
    let one = run("1");
    assert_eq!(one, run("2"));
    let rows = one.0["rows"].as_array().cloned().unwrap_or_default();
    assert_eq!(rows.len(), 4);
    for row in &rows {
        keys(
            row,
            &[
                "controller",
                "posture",
                "mu",
                "reference",
                "z_sliding_m",
                "limit_m",
                "paper_m",
            ],
        );
    }
    let of = |controller: &str, posture: &str| {
        let is = |row: &&Value| row["controller"] == controller && row["posture"] == posture;
        rows.iter().find(is).cloned().unwrap_or_default()
    };
    assert_eq!(of("pid", "elbow-up")["z_sliding_m"], Value::Null);
    assert_eq!(of("pid", "elbow-down")["paper_m"], 0.0375);
    assert!(of("pid", "elbow-down")["z_sliding_m"].as_f64() > Some(0.0375));
    assert!(of("hybrid", "elbow-down")["z_sliding_m"].as_f64() > Some(0.16));
    assert!(of("hybrid", "elbow-up")["z_sliding_m"].as_f64() > Some(0.17));
}

#[test]
fn the_closed_loop_keeps_its_contract() {
    let bench = Bench::new("loop");
    let report = bench.report(&[&CLOSED_LOOP[..], &["--json"]].concat());
    let rows = report["rows"].as_array().cloned().unwrap_or_default();
    let speeds: Vec<f64> = rows
        .iter()
        .filter_map(|row| row["v_belt_m_s"].as_f64())
        .collect();
    assert_eq!(rows.len(), 4 * 4);
    assert_eq!(
        [speeds[0], speeds[4], speeds[8], speeds[15]],
        [-0.6, -0.2, 0.2, 0.6]
    );
    for row in &rows {
        keys(
            row,
            &[
                "mu",
                "v_belt_m_s",
                "initial",
                "max_theta1_dot_rad_s",
                "bouncing",
                "contact_fraction",
                "lift_offs",
                "fault",
            ],
        );
    }
    assert_eq!(rows[0]["bouncing"], false);
    assert_eq!(rows[0]["lift_offs"], 0);
}

#[test]
fn a_scenario_file_can_be_the_controller() {
    let bench = Bench::new("file");
    let file = "[controller.law.hybrid]\nnormal_force_n = 6.0\n";
    std::fs::write(bench.path("gentle.toml"), file).unwrap_or_default();
    let arguments = [
        "study",
        "sliding-range",
        "--controller",
        "gentle.toml",
        "--converters",
        "own",
        "--posture",
        "elbow-down",
        "--scan-step-m",
        "0.1",
        "--resolution-m",
        "0.02",
        "--json",
    ];
    let report = bench.report(&arguments);
    let row = &report["rows"][0];
    assert_eq!(row["controller"], "gentle.toml");
    assert_eq!(row["paper_m"], Value::Null);
    assert!(row["z_sliding_m"].as_f64() > Some(0.1), "{report}");
}

/// Existing files stay, and none are added.
#[test]
fn mistakes_are_reported_in_one_line_and_overwrite_nothing() {
    let bench = Bench::new("mistakes");
    std::fs::write(bench.path("old.csv"), "old").unwrap_or_default();
    for (arguments, expected) in [
        (
            &["admissible", "--mu", "-1"][..],
            &["--mu = -1", "0 to 10"][..],
        ),
        (&["admissible", "--mu", "nan"], &["--mu = NaN"]),
        (&["admissible", "--set", "belt.friction=1"], &["use --mu"]),
        (
            &["admissible", "--set", "arm.height=1"],
            &["arm.height", "height_m"],
        ),
        (
            &["admissible", "--set", "arm.height_m=0.42"],
            &["arm.height_m = 0.42"],
        ),
        (
            &["regions", "--theta1-deg", "40:50:1"],
            &["below 37.10 degrees"],
        ),
        (&["regions", "--theta1-deg", "0:1:0"], &["step 0"]),
        (
            &["closed-loop-bifurcation", "--v-belt", "-0.1:-1:0.1"],
            &["is empty", "leads away"],
        ),
        (
            &["closed-loop-bifurcation", "--v-belt", "-1:-0.1:-0.1"],
            &["is empty", "step 0.1"],
        ),
        (
            &["closed-loop-bifurcation", "--v-belt", ""],
            &["holds no values"],
        ),
        (
            &["closed-loop-bifurcation", "--mu", "-0.5"],
            &["belt.friction = -0.5"],
        ),
        (
            &["closed-loop-bifurcation", "--mu", "inf"],
            &["is not a number from -1e9 to 1e9"],
        ),
        (&["closed-loop-bifurcation", "--initial", "x"], &["'x'"]),
        (
            &["closed-loop-bifurcation", "--transient-s", "-1"],
            &["give seconds from"],
        ),
        (
            &["closed-loop-bifurcation", "--target-m", "0.5"],
            &["--target-m = 0.5 is outside the allowed range -0.184102 to 0.184102"],
        ),
        (
            &["sliding-range", "--posture", "elbow-left"],
            &["elbow-left", "elbow-up"],
        ),
        (
            &["sliding-range", "--controller", "lqr"],
            &["lqr", "hybrid-elbow-down"],
        ),
        (
            &["sliding-range", "--converters", "best"],
            &["best", "hardware"],
        ),
        (
            &["sliding-range", "--reference", "jerk:3"],
            &["minimum-jerk:SECONDS"],
        ),
        (
            &["sliding-range", "--resolution-m", "0"],
            &["give metres from"],
        ),
        (
            &["sliding-range", "--set", "initial.theta1_deg=1"],
            &["use --posture"],
        ),
        (
            &["sliding-range", "--set", "controller.law.pid.x=1"],
            &["controller.law.pid"],
        ),
        (&["sliding-range", "--threads", "0"], &["--threads"]),
    ] {
        let mut all = vec!["study"];
        all.extend(arguments);
        all.extend(["--csv", "old.csv"]);
        let output = bench.run(&all);
        let message = errors(&output);
        assert_eq!(code(output.status), 2, "{arguments:?}: {message}");
        for part in expected {
            assert!(message.contains(part), "'{part}' is not in: {message}");
        }
        assert!(output.stdout.is_empty());
    }
    assert_eq!(bench.files(), ["old.csv"]);
    assert_eq!(
        std::fs::read(bench.path("old.csv")).unwrap_or_default(),
        b"old"
    );
}

#[test]
#[ignore = "draws every figure"]
fn the_page_of_all_figures_is_self_contained() {
    let bench = Bench::new("figures");
    let result = bench.report(&["figures", "--draft", "--out", "page", "--json"]);
    assert_eq!(result["page"], "page/index.html");
    assert_eq!(result["draft"], true);
    for file in result["files"].as_array().unwrap_or(&Vec::new()) {
        let file = file.as_str().unwrap_or_default();
        assert!(bench.path(file).exists(), "{file} was not written");
    }
    let sections = result["sections"].as_array().map_or(&[][..], Vec::as_slice);
    assert!(sections.len() >= 11, "{result}");
    for section in sections {
        keys(section, &["name", "title", "commands", "comparisons"]);
        for comparison in section["comparisons"].as_array().unwrap_or(&Vec::new()) {
            keys(comparison, &["what", "paper", "here", "verdict"]);
        }
    }
    let html = std::fs::read_to_string(bench.path("page/index.html")).unwrap_or_default();
    let files = bench.files();
    for name in [
        "admissible",
        "regions",
        "bifurcation-section",
        "bifurcation",
        "poincare",
        "sliding-range",
        "closed-loop-bifurcation",
        "run-pid-elbow-down",
        "run-pid-elbow-up",
        "run-hybrid-elbow-down",
        "run-hybrid-elbow-up",
    ] {
        assert!(html.contains(&format!("<h2 id=\"{name}\">")), "{name}");
        let svg =
            std::fs::read_to_string(bench.path(&format!("page/{name}.svg"))).unwrap_or_default();
        assert!(
            !svg.is_empty() && html.contains(&svg),
            "{name}.svg is not on the page"
        );
        if !name.starts_with("run-") {
            assert!(files.contains(&format!("page/{name}.csv")), "{files:?}");
            assert!(files.contains(&format!("page/{name}.json")), "{files:?}");
        }
    }
    // These are XML namespaces, not network addresses.
    let without_names = html.replace("http://www.w3.org/2000/svg", "");
    assert!(!without_names.contains("http:") && !without_names.contains("https:"));
    assert!(!html.contains("<script") && !html.contains("<img"));
    for words in [
        "0.168",
        "μ = 0.5",
        "agrees",
        "differs",
        "0.0375 m",
        "never bounces",
    ] {
        assert!(html.contains(words), "'{words}' is not on the page");
    }
}

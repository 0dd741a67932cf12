//! `painleve identify`: in rehearsal, and from records of slides.

#![allow(clippy::unwrap_used)]

use painleve_commission::identification::{FORCE_N, slide_scenario};
use painleve_plant::scenario::Scenario;
use painleve_shared::Posture;
use painleve_tests::printed::check_figure;
use painleve_tests::{Bench, code, errors};
use serde_json::Value;

const FRICTION_NM: f64 = 0.05;

fn friction_nm(found: &Value, joint: usize) -> f64 {
    let friction = &found["joints"][joint]["coulomb_friction_nm"];
    friction["value"].as_f64().unwrap()
}

#[test]
fn a_rehearsal_writes_what_it_has_found() {
    let bench = Bench::new("identify");
    let found = bench.report(&["identify", "--rehearse", "--seed", "3", "--json"]);
    assert!(found["tip_deviation_m"].as_f64().unwrap() < 6e-4, "{found}");
    for posture in ["elbow_down", "elbow_up"] {
        let found = &found["set_down"][posture];
        let [from_m, to_m] = [0, 1].map(|end| found["stretch_m"][end].as_f64().unwrap());
        let best_m = found["best_m"].as_f64().unwrap();
        assert!(
            from_m <= best_m && best_m <= to_m && to_m - from_m > 0.2,
            "{found}"
        );
    }
    let of_plant = [
        "drive",
        "out/rehearsed/identified.toml",
        "--port",
        "/dev/null",
        "--set",
        "arm.tip_mass_kg=0.1",
    ];
    let without_effect = errors(&bench.run(&of_plant));
    let reason = "--set arm.tip_mass_kg=0.1 has no effect on a real arm";
    assert!(without_effect.contains(reason), "{without_effect}");
    let differences = bench.report(&[
        "diff",
        "hybrid-elbow-down",
        "out/rehearsed/identified.toml",
        "--json",
    ]);
    let written = differences["differences"].as_array().unwrap();
    let page = std::fs::read_to_string(bench.path("out/rehearsed/identified.html")).unwrap();
    for part in [
        "Identification: hybrid-elbow-down",
        "friction",
        "The arm's model explains",
        "with all but the geometry as in the scenario",
        "Set the tip down here",
    ] {
        assert!(page.contains(part), "{part}: {page}");
    }
    let begin = page.find("<svg").unwrap();
    let (figure, _) = page[begin..].split_once("</svg>").unwrap();
    check_figure("identified.svg", &format!("{figure}</svg>\n"));
    for key in [
        "arm_model",
        "controller.estimator.encoders.zero_rad",
        "knowledge.coulomb_friction_nm",
    ] {
        let has = |it: &&Value| it["key"].as_str().is_some_and(|it| it.starts_with(key));
        assert!(written.iter().any(|it| has(&it)), "{key}: {differences}");
    }
}

/// A link 1 that was measured later is no change.
#[test]
#[ignore = "a long identification"]
fn an_arm_that_has_changed_since_it_was_identified_is_told() {
    let bench = Bench::new("identify-again");
    bench.report(&["identify", "--rehearse", "--seed", "3", "--json"]);
    let changes = |seed: &str, length: &[&str]| {
        let line = [
            "identify",
            "out/rehearsed/identified.toml",
            "--rehearse",
            "--output",
            "out/rehearsed-again.toml",
            "--seed",
            seed,
            "--json",
        ];
        let report = bench.report(&[&line[..], length].concat());
        let page = std::fs::read_to_string(bench.path("out/rehearsed-again.html")).unwrap();
        let changes: Vec<String> = serde_json::from_value(report["changes"].clone()).unwrap();
        assert_eq!(page.matches("Warning: ").count(), changes.len());
        changes
    };
    let other_arm = changes("4", &[]);
    for change in ["the arm has changed: ", "the spring of "] {
        assert!(
            other_arm.iter().any(|it| it.starts_with(change)),
            "{other_arm:?}"
        );
    }
    assert_eq!(changes("3", &[]), [""; 0]);
    assert_eq!(changes("3", &["--link-1-m", "0.2105"]), [""; 0]);
}

#[test]
#[ignore = "a long identification"]
fn a_length_that_no_drawing_explains_is_told() {
    let bench = Bench::new("identify-length");
    let warns = |length_m: &str| {
        let run = bench.run(&["identify", "--rehearse", "--link-1-m", length_m]);
        errors(&run).contains("measure link 1 again")
    };
    assert!(warns("0.2163"));
    assert!(!warns("0.2105"));
}

#[test]
fn a_rehearsals_scenario_drives_no_real_arm() {
    let bench = Bench::new("rehearsed");
    let rehearsal = bench.run(&["commission", "--rehearse"]);
    assert!(rehearsal.status.success(), "{}", errors(&rehearsal));
    for command in [
        &["drive"][..],
        &["drive", "--store"],
        &["identify"],
        &["commission"],
    ] {
        let of_rehearsal = ["out/rehearsed/commissioned.toml", "--port", "/dev/null"];
        let refused = bench.run(&[command, &of_rehearsal].concat());
        assert_eq!(code(refused.status), 2, "{}", errors(&refused));
        let reason = "describes a simulated arm (knowledge.source: rehearsal with seed 1)";
        assert!(errors(&refused).contains(reason), "{}", errors(&refused));
    }
}

#[test]
fn a_resolution_that_a_boards_parts_do_not_have_is_refused() {
    let bench = Bench::new("resolution");
    for (part, has) in [("encoder", 14), ("force", 12)] {
        let finer = format!("converters.{part}.bits=16");
        let drive = &[
            "drive",
            "edge",
            "--port",
            "/dev/null",
            "--dry-run",
            "--no-record",
        ][..];
        let commission = &["commission", "edge", "--port", "/dev/null"][..];
        let drivers = &[
            "run",
            "edge",
            "--host",
            "drivers",
            "--no-record",
            "--no-plot",
        ][..];
        for line in [drive, commission, drivers] {
            let refused = bench.run(&[line, &["--set", &finer]].concat());
            assert_eq!(code(refused.status), 2, "{line:?}: {}", errors(&refused));
            let reason =
                format!("converters.{part}.bits = 16: the board's part has only {has} bits");
            assert!(errors(&refused).contains(&reason), "{}", errors(&refused));
        }
    }
}

/// Its parts may be mounted in the other direction; without a scenario, it would be the paper's arm.
#[test]
fn an_arm_that_was_not_commissioned_or_not_named_slides_nowhere() {
    let bench = Bench::new("not-commissioned");
    let new = bench.run(&["identify", "edge", "--port", "/dev/null"]);
    assert_eq!(code(new.status), 2, "{}", errors(&new));
    let reason = "has never been commissioned";
    assert!(errors(&new).contains(reason), "{}", errors(&new));
    for command in ["drive", "commission", "identify"] {
        let unnamed = bench.run(&[command, "--port", "/dev/null"]);
        assert_eq!(code(unnamed.status), 2, "{}", errors(&unnamed));
        assert!(
            errors(&unnamed).contains("<SCENARIO>"),
            "{}",
            errors(&unnamed)
        );
    }
}

/// Records a slide of an arm with friction that its controller does not know; returns the file.
fn recorded(bench: &Bench, posture: Posture, name: &str) -> String {
    let overrides = [
        "contact.kind=compliant".to_owned(),
        format!("effects.joints.coulomb_nm={FRICTION_NM}"),
        format!(
            "initial={{ tip_m = 0.0, elbow = '{}' }}",
            &name["elbow-".len()..]
        ),
    ];
    let arm = Scenario::default()
        .with_overrides("arm", &overrides)
        .unwrap();
    let slide = slide_scenario(&arm, 0.93, posture, FORCE_N).unwrap();
    std::fs::write(bench.path("slide.toml"), slide.to_commented_toml()).unwrap();
    let file = format!("{name}.mcap");
    let report = bench.report(&[
        "run",
        "slide.toml",
        "--record",
        &file,
        "--no-plot",
        "--json",
    ]);
    assert!(report["kept"].as_bool().unwrap(), "{report}");
    file
}

#[test]
#[ignore = "a long identification"]
fn records_of_slides_show_an_arm() {
    let bench = Bench::new("identify-records");
    let down = recorded(&bench, Posture::ElbowDown, "elbow-down");
    let up = recorded(&bench, Posture::ElbowUp, "elbow-up");
    let table = bench.run(&["export", &up, "--csv", "up.csv"]);
    assert!(table.status.success(), "{}", errors(&table));
    let slides = [format!("elbow-down={down}"), "elbow-up=up.csv".to_owned()];
    let line = [
        "identify", "--slide", &slides[0], "--slide", &slides[1], "--json",
    ];
    let found = bench.report(&line);
    for joint in 0..2 {
        let error_nm = friction_nm(&found, joint) - FRICTION_NM;
        assert!(error_nm.abs() < 0.06 * FRICTION_NM, "{joint}: {found}");
    }
    // Records of a simulation describe no real arm, either.
    let driven = bench.run(&["drive", "out/identified.toml", "--port", "/dev/null"]);
    let reason = "simulated arm (knowledge.source: rehearsal: 2 recorded slides)";
    assert!(errors(&driven).contains(reason), "{}", errors(&driven));
    let twice = [&line[..], &["--slide", &slides[0]]].concat();
    let twice = bench.run(&twice);
    assert!(
        errors(&twice).contains("it is the slide of elbow-down.mcap; give each slide once"),
        "{}",
        errors(&twice)
    );
    let rescaled = [&line[..], &["--set", "converters.force.range_n=30"]].concat();
    let refused = bench.run(&rescaled);
    assert_eq!(code(refused.status), 2, "{}", errors(&refused));
    let reason = "elbow-down.mcap: its converters.force.range_n is 20.0, that of the scenario 30.0";
    assert!(errors(&refused).contains(reason), "{}", errors(&refused));
    let slower = bench.run(&[&line[..], &["--set", "run.tick_hz=500"]].concat());
    assert_eq!(code(slower.status), 2, "{}", errors(&slower));
    assert!(
        errors(&slower).contains("its run.tick_hz is 1000"),
        "{}",
        errors(&slower)
    );
    // Told the wrong posture, it writes nothing, and says that the files are not of this run.
    let before = std::fs::read(bench.path("out/identified.toml")).unwrap();
    let swapped = ["elbow-up=elbow-down.mcap", "elbow-down=up.csv"];
    let refused = bench.run(&["identify", "--slide", swapped[0], "--slide", swapped[1]]);
    assert_eq!(code(refused.status), 1, "{}", errors(&refused));
    for part in [
        "not as told",
        "out/identified.toml is still that of an earlier run",
        "out/identified.html is still that of an earlier run",
    ] {
        assert!(errors(&refused).contains(part), "{}", errors(&refused));
    }
    let after = std::fs::read(bench.path("out/identified.toml")).unwrap();
    assert_eq!(before, after);
}

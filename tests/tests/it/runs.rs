//! The main use case, end to end: two processes over shared memory, and their output files.

use std::io::Write;
use std::process::Stdio;

use painleve_plant::closed_loop::ClosedLoop;
use painleve_plant::controller_host::InProcess;
use painleve_plant::scenario::{Scenario, built_in};
use painleve_plant::simulation::Simulation;
use painleve_tests::{Bench, code, errors, skipped};
use serde_json::Value;

const QUIET: [&str; 2] = ["--no-record", "--no-plot"];

fn number(report: &Value, key: &str) -> f64 {
    report[key]
        .as_f64()
        .unwrap_or_else(|| panic!("{key} is no number in {report}"))
}

#[test]
fn the_default_run_slides_to_the_papers_limit_without_lift_off() {
    let bench = Bench::new("default");
    let report = bench.report(&["--json"]);
    assert_eq!(report["scenario"], "hybrid-elbow-down");
    assert_eq!(
        (report["tick_hz"].as_u64(), report["ticks"].as_u64()),
        (Some(1000), Some(6000))
    );
    assert_eq!(report["lift_offs"], 0);
    assert_eq!(report["first_lift_off_s"], Value::Null);
    assert!(
        (number(&report, "final_tip_t_m") - 0.148).abs() < 1e-3,
        "{report}"
    );
    assert_eq!(number(&report, "final_reference_m"), 0.148);
    assert_eq!(
        bench.files(),
        ["out/run.html", "out/run.mcap", "out/run.svg"]
    );
}

#[test]
fn the_elbow_up_run_slides_to_its_limit_too() {
    let bench = Bench::new("up");
    let report = bench.report(&["run", "hybrid-elbow-up", "--json"]);
    assert_eq!(report["lift_offs"], 0);
    assert!(
        (number(&report, "final_tip_t_m") - 0.163).abs() < 1e-3,
        "{report}"
    );
}

/// Zero would be a place on the belt, and a time.
#[test]
fn a_run_without_an_answer_has_no_reference_and_no_round_trip() {
    let bench = Bench::new("unanswered");
    let short = ["--set", "run.duration_s=0.1"];
    let lost = ["--set", "converters.link.frame_loss=1"];
    let edge = [&["run", "edge"], &QUIET[..], &short, &lost].concat();
    let report = bench.report(&[&edge[..], &["--json"]].concat());
    for key in ["final_reference_m", "error_m", "round_trip_us"] {
        assert_eq!(report[key], Value::Null, "{report}");
    }
    // The law `off` follows no reference, whatever its supervisor says.
    let off = [&["run", "open-loop-bounce", "--json"], &QUIET[..], &short].concat();
    let off = bench.report(&off);
    assert_eq!(off["final_reference_m"], Value::Null, "{off}");
    assert!(off["round_trip_us"].is_object(), "{off}");
    let table = bench.run(&edge).stdout;
    let table = String::from_utf8_lossy(&table);
    assert!(table.contains("mm, reference –"), "{table}");
    let row = table.lines().find(|line| line.contains("round trip"));
    assert!(row.is_some_and(|row| row.contains("┆ – ")), "{table}");
}

#[test]
fn a_run_fails_on_the_requested_events_only() {
    let bench = Bench::new("fail-on");
    let run = |name: &str, events: &str| {
        let arguments = [
            "run",
            name,
            "--json",
            QUIET[0],
            QUIET[1],
            "--fail-on",
            events,
        ];
        bench.run(&arguments)
    };
    let kept = run("hybrid-elbow-down", "fault,lift-off");
    assert_eq!(kept.status.code(), Some(0), "{kept:?}");
    let lost = run("pid-elbow-up", "lift-off");
    assert_eq!(lost.status.code(), Some(6), "{lost:?}");
    assert!(
        String::from_utf8_lossy(&lost.stderr).contains("lift-offs: 3"),
        "{lost:?}"
    );
    let report: Value = serde_json::from_slice(&lost.stdout).unwrap();
    assert_eq!(report["lift_offs"], 3);
}

#[test]
fn the_pid_keeps_contact_elbow_down_and_loses_it_elbow_up() {
    let bench = Bench::new("pid");
    let down = bench.report(&["run", "pid-elbow-down", "--json", QUIET[0], QUIET[1]]);
    assert_eq!(down["lift_offs"], 0);
    assert!(
        (number(&down, "final_tip_t_m") - 0.0375).abs() < 2e-3,
        "{down}"
    );
    let up = bench.report(&["run", "pid-elbow-up", "--json", QUIET[0], QUIET[1]]);
    assert!(number(&up, "lift_offs") >= 1.0, "{up}");
    assert!(up["first_lift_off_s"].is_number());
}

#[test]
fn without_control_the_arm_keeps_bouncing_from_x0_a() {
    let bench = Bench::new("bounce");
    let report = bench.report(&["run", "open-loop-bounce", "--json", QUIET[0], QUIET[1]]);
    assert_eq!(report["controller"], "off");
    assert_eq!(report["impacts_without_collision"], 1);
    assert_eq!(number(&report, "peak_torque_nm"), 0.0);
    assert!(number(&report, "impacts") > 50.0);
    assert!(number(&report, "contact_fraction") < 0.01);
}

#[test]
fn the_papers_own_gains_work_with_ideal_converters() {
    let bench = Bench::new("paper");
    let report = bench.report(&["run", "paper-gains", "--json", QUIET[0], QUIET[1]]);
    assert_eq!(report["lift_offs"], 0);
    assert!(
        (number(&report, "final_tip_t_m") - 0.148).abs() < 1e-5,
        "{report}"
    );
    assert!(
        (number(&report, "min_normal_force_n") - 10.0).abs() < 0.1,
        "{report}"
    );
}

/// Names that other programs rely on. Add to the report, never rename.
#[test]
fn the_report_keeps_its_contract() {
    let report = Bench::new("contract").report(&["run", "--set", "run.duration_s=0.2", "--json"]);
    for key in [
        "scenario",
        "controller",
        "host",
        "ticks",
        "tick_hz",
        "sim_s",
        "wall_s",
        "realtime_factor",
        "lift_offs",
        "first_lift_off_s",
        "impacts",
        "impacts_without_collision",
        "max_tip_t_m",
        "final_tip_t_m",
        "final_reference_m",
        "requested_target_m",
        "min_normal_force_n",
        "peak_torque_nm",
        "contact_fraction",
        "saturated_ticks",
        "stale_ticks",
        "round_trip_us",
        "log_hash",
    ] {
        assert!(report.get(key).is_some(), "{key} is missing in {report}");
    }
    for key in ["p50", "p99", "p999", "max"] {
        assert!(
            report["round_trip_us"][key].is_number(),
            "{key} in {report}"
        );
    }
    assert_eq!(report["host"], "native");
}

/// One process or two, first run or second: the same frames.
#[test]
fn every_scenario_gives_the_same_frames_in_one_process_and_in_two() {
    let bench = Bench::new("hash");
    for name in built_in::names() {
        let scenario = Scenario::load(name, &[]).unwrap();
        let simulation = Simulation::new(&scenario).unwrap();
        let host = InProcess::new(&scenario.controller_configuration()).unwrap();
        let mut closed_loop = ClosedLoop::new(simulation, host);
        for _ in 0..scenario.run.ticks() {
            closed_loop.tick(&mut ()).unwrap();
        }
        let here = closed_loop.finish().0.log_hash;
        let arguments = ["run", name, "--json", QUIET[0], QUIET[1]];
        // The shortest run stands for the second ones of the others.
        let runs = if name == "capture" { 2 } else { 1 };
        for _ in 0..runs {
            assert_eq!(
                bench.report(&arguments)["log_hash"],
                here.as_str(),
                "{name}"
            );
        }
    }
}

#[test]
fn another_seed_gives_another_run() {
    let bench = Bench::new("seed");
    let hash = |seed: &str| {
        let seed = format!("run.seed={seed}");
        let arguments = [
            "run",
            "--set",
            "run.duration_s=0.5",
            "--set",
            &seed,
            "--json",
            QUIET[0],
            QUIET[1],
        ];
        bench.report(&arguments)["log_hash"].clone()
    };
    assert_ne!(hash("1"), hash("2"));
}

#[test]
fn counters_that_wrap_change_nothing() {
    let bench = Bench::new("wrap");
    let run = |first_tick: &str| {
        let first_tick = format!("run.first_tick={first_tick}");
        let mut report = bench.report(&[
            "run",
            "--set",
            "run.duration_s=1",
            "--set",
            &first_tick,
            "--json",
            QUIET[0],
            QUIET[1],
        ]);
        for varying in ["wall_s", "realtime_factor", "round_trip_us", "log_hash"] {
            report[varying] = Value::Null;
        }
        report
    };
    let wrapped = run("4294966900");
    assert_eq!(wrapped["fault"], Value::Null);
    assert_eq!(wrapped, run("0"));
}

#[test]
fn simultaneous_runs_do_not_interfere() {
    let bench = Bench::new("side");
    let arguments = [
        "run",
        "--set",
        "run.duration_s=2",
        "--json",
        QUIET[0],
        QUIET[1],
    ];
    let alone = bench.report(&arguments)["log_hash"].clone();
    let running: Vec<_> = (0..3).map(|_| bench.start(&arguments)).collect();
    for run in running {
        let (output, _) = run.end(std::time::Duration::from_secs(60));
        assert!(output.status.success(), "{output:?}");
        let report: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(report["log_hash"], alone);
    }
}

#[test]
fn a_realtime_run_takes_as_long_as_its_simulated_time() {
    let bench = Bench::new("clock");
    let mut arguments = vec!["run", "--pacing", "realtime", "--json", QUIET[0], QUIET[1]];
    // Other tests may delay this run beyond the controller's limits.
    for key in [
        "run.duration_s=0.5",
        "controller.lapses.overruns=100",
        "controller.lapses.missing_frames=100",
        "controller.lapses.lost_frames=100",
    ] {
        arguments.extend(["--set", key]);
    }
    let report = bench.report(&arguments);
    assert_eq!(report["pacing"], "realtime");
    assert_eq!(report["ticks"], 500);
    assert!((0.499..10.0).contains(&number(&report, "wall_s")));
    assert!(report["wake_up_us"]["max"].is_number());
}

#[test]
fn the_table_and_the_list_are_readable() {
    let bench = Bench::new("people");
    let output = bench.run(&["run", "--set", "run.duration_s=0.2"]);
    let text = String::from_utf8_lossy(&output.stdout);
    for part in ["hybrid-elbow-down", "lift-offs", "round trip", "real time"] {
        assert!(text.contains(part), "'{part}' is not in\n{text}");
    }
    assert!(output.stderr.is_empty(), "{output:?}");
    let list = bench.run(&["scenarios"]);
    let text = String::from_utf8_lossy(&list.stdout);
    assert!(built_in::names().all(|name| text.contains(name)), "{text}");
    // The printed text is a valid scenario file.
    let printed = bench.run(&["scenarios", "paper-gains"]).stdout;
    std::fs::write(bench.path("printed.toml"), printed).unwrap();
    let path = bench.path("printed.toml");
    let again = Scenario::load(path.to_str().unwrap(), &[]).unwrap();
    assert_eq!(again, Scenario::load("paper-gains", &[]).unwrap());
}

#[test]
fn the_record_holds_every_tick_with_its_schema() {
    let bench = Bench::new("record");
    let report = bench.report(&[
        "--json",
        "--set",
        "run.duration_s=0.5",
        "--record",
        "deep/er/log.mcap",
    ]);
    let bytes = std::fs::read(bench.path("deep/er/log.mcap")).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let statistics = summary.stats.unwrap();
    for topic in ["/plant", "/sensor", "/actuator", "/estimates"] {
        let (id, _) = summary
            .channels
            .iter()
            .find(|(_, channel)| channel.topic == topic)
            .unwrap();
        let messages = statistics.channel_message_counts.get(id).copied();
        assert_eq!(messages, report["ticks"].as_u64(), "{topic}");
    }
    assert!(
        summary
            .channels
            .values()
            .all(|channel| channel.schema.is_some())
    );
}

#[test]
fn a_scenario_from_standard_input_runs_like_the_built_in_one() {
    let bench = Bench::new("standard-input");
    let shortened = ["--set", "run.duration_s=0.2", "--no-plot", "--json"];
    let text = bench.run(&["scenarios", "edge"]).stdout;
    let mut command = bench.command(&[&["run", "-"], &shortened[..]].concat());
    let mut child = command
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    child.stdin.take().unwrap().write_all(&text).unwrap();
    let output = child.wait_with_output().unwrap();
    let piped: Value = serde_json::from_slice(&output.stdout).unwrap();
    let named = bench.report(&[&["run", "edge"], &shortened[..]].concat());
    assert_eq!(piped["log_hash"], named["log_hash"]);
    assert_eq!(piped["requested_target_m"], named["requested_target_m"]);
}

#[test]
fn a_figure_with_another_extension_is_refused_and_so_is_one_that_cannot_be_converted() {
    let bench = Bench::new("extension");
    let refused = |plot: &str, path: &str, part: &str| {
        let mut command = bench.command(&["run", "--plot", plot]);
        let output = command.env("PATH", path).output().unwrap();
        assert_eq!(code(output.status), 2, "{output:?}");
        assert!(errors(&output).contains(part), "{output:?}");
    };
    refused("run.jpg", "", ".svg, .png or .pdf, not with .jpg");
    refused("run.png", "/nowhere", "apt-get install librsvg2-bin");
    assert!(bench.files().is_empty());
}

#[test]
fn figures_are_png_or_pdf_files_by_their_extension() {
    let version = std::process::Command::new("rsvg-convert")
        .arg("--version")
        .output();
    if version.is_err() {
        skipped("rsvg-convert not found; on Debian: apt-get install librsvg2-bin");
        return;
    }
    let bench = Bench::new("pictures");
    let short = [
        "run",
        "--set",
        "run.duration_s=0.1",
        "--no-record",
        "--no-html",
    ];
    for (name, start) in [("run.png", &b"\x89PNG"[..]), ("run.pdf", b"%PDF-")] {
        let draw = || {
            bench.report(&[&short[..], &["--json", "--plot", name]].concat());
            std::fs::read(bench.path(name)).unwrap()
        };
        let bytes = draw();
        assert!(bytes.starts_with(start) && bytes.len() > 5000, "{name}");
        assert!(bytes == draw(), "{name} differs between two equal runs");
    }
    let study = [
        "study",
        "admissible",
        "--mu",
        "0.6",
        "--json",
        "--svg",
        "a.png",
    ];
    bench.report(&study);
    assert!(
        std::fs::read(bench.path("a.png"))
            .unwrap()
            .starts_with(b"\x89PNG")
    );
}

#[test]
fn a_run_that_is_being_written_is_not_overwritten() {
    let bench = Bench::new("being-written");
    let first = bench.start(&["run", "--set", "run.duration_s=3600"]);
    let start = std::time::Instant::now();
    while !bench.files().iter().any(|file| file.contains(".run.mcap.")) {
        assert!(start.elapsed().as_secs() < 20, "{:?}", bench.files());
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    let output = bench.run(&["run", "--set", "run.duration_s=0.1"]);
    assert_eq!(code(output.status), 4, "{output:?}");
    assert!(
        errors(&output).contains("run.mcap` is being written"),
        "{output:?}"
    );
    let other = ["run", "--set", "run.duration_s=0.1", "--json", "--no-plot"];
    bench.report(&[&other[..], &["--record", "out/other.mcap"]].concat());
    painleve_tests::signal(first.id(), nix::sys::signal::Signal::SIGINT);
    let (output, _) = first.end(std::time::Duration::from_secs(20));
    assert_eq!(code(output.status), 130, "{output:?}");
    bench.report(&["run", "--set", "run.duration_s=0.1", "--json"]);
}

/// The place with p = 0 is where the scenario `edge` says: at 164.71 mm.
#[test]
fn a_run_held_by_an_edge_reports_how_near_it_rests_and_why_not_nearer() {
    let bench = Bench::new("reach");
    let number = |report: &Value, key: &str| report[key].as_f64().unwrap_or(f64::NAN);
    let quiet = ["--no-record", "--no-plot", "--json"];
    let known = bench.report(&[&["run", "edge"], &quiet[..]].concat());
    let expected_m = 0.16471 - number(&known, "final_tip_t_m");
    assert!(
        (number(&known, "to_edge_m") - expected_m).abs() < 2e-5,
        "{known}"
    );
    assert_eq!(known["chief_doubt"], Value::Null);
    let doubtful = [
        "controller.estimator.tip_deviation_m=0.002",
        "knowledge.encoder_zero_rad=[0.005, 0.001]",
    ];
    let doubtful = doubtful.iter().flat_map(|change| ["--set", change]);
    let doubtful: Vec<&str> = ["run", "edge"]
        .into_iter()
        .chain(doubtful)
        .chain(quiet)
        .collect();
    let doubtful = bench.report(&doubtful);
    let farther_m = number(&doubtful, "to_edge_m") - number(&known, "to_edge_m");
    let kept_m = number(&doubtful, "distance_for_knowledge_m");
    assert!((farther_m - kept_m).abs() < 1e-4, "{doubtful}");
    assert_eq!(
        doubtful["chief_doubt"],
        "the encoders' zeros are known to 0.29°"
    );
    let free = bench.report(&[&["run", "hybrid-elbow-down"], &quiet[..]].concat());
    assert_eq!(free["to_edge_m"], Value::Null);
    // A doubt that costs little is not the whole reason.
    let table = bench.run(&[
        "run",
        "edge",
        "--set",
        "controller.estimator.tip_deviation_m=0.0003",
        "--set",
        "controller.governor.p_per_kg=3.0",
        "--no-record",
        "--no-plot",
    ]);
    let table = String::from_utf8_lossy(&table.stdout);
    assert!(
        table.contains("mm short: controller.governor.p_per_kg keeps p at 3 or more, 0.2 mm of it because the tip"),
        "{table}"
    );
}

#[test]
fn only_an_edge_towards_the_request_is_reported() {
    let bench = Bench::new("ahead");
    let to_edge = |line: &[&str]| {
        let quiet = ["--no-record", "--no-plot", "--json"];
        bench.report(&[&["run"], line, &quiet[..]].concat())["to_edge_m"].clone()
    };
    // Held where p/Q22 is least, and at the end of the reach.
    let least = [
        "--set",
        "belt.friction=0.95",
        "--set",
        "initial={tip_m=0.1,elbow=\"up\"}",
        "--set",
        "controller.reference=[{minimum-jerk={target_m=-0.183,duration_s=3.0}}]",
    ];
    assert_eq!(to_edge(&least), Value::Null);
    assert_eq!(to_edge(&["--replay", "1:2"]), Value::Null);
    // Elbow up, p = 0 at 0.18269 m, short of the full reach of 0.18410 m.
    let near = "controller.reference.0.minimum-jerk.target_m=0.183";
    let near_m = to_edge(&["hybrid-elbow-up", "--set", near]).as_f64();
    assert!(near_m.is_some_and(|near_m| (0.0..0.005).contains(&near_m)));
}

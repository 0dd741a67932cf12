//! Every failure ends with one message, an exit code, and no leftovers.

use std::os::unix::fs::{PermissionsExt, chown};
use std::process::{Command, Output, Stdio};
use std::sync::Barrier;
use std::time::Duration;

use nix::sys::signal::Signal;
use nix::unistd::Uid;
use painleve_tests::{Bench, child_of, code, errors, is_running, program, signal, skipped};
use serde_json::Value;

/// A peer detects the end of the other within 2 s; the margin is for a machine busy with other
/// tests. The process must never hang.
const NOTICE: Duration = Duration::from_secs(6);

/// A run that is still active when the test interferes.
const LONG: [&str; 4] = ["run", "--set", "run.duration_s=100000", "--json"];

fn assert_refused(bench: &Bench, arguments: &[&str], exit: i32, parts: &[&str]) {
    let output = bench.run(arguments);
    let message = errors(&output);
    assert_eq!(code(output.status), exit, "{arguments:?}: {message}");
    assert_eq!(
        message.trim().lines().count(),
        1,
        "{arguments:?}: {message}"
    );
    assert!(message.starts_with("error: "), "{message}");
    for part in parts {
        assert!(message.contains(part), "'{part}' is not in: {message}");
    }
    assert!(output.stdout.is_empty(), "{output:?}");
    let files = bench.files();
    assert!(
        files.iter().all(|file| file.ends_with(".toml")),
        "{files:?}"
    );
}

#[test]
fn bad_scenarios_are_refused_by_name_and_range() {
    let bench = Bench::new("bad");
    std::fs::write(bench.path("empty.toml"), "").unwrap();
    std::fs::write(bench.path("typo.toml"), "[belt]\nfricton = 0.5\n").unwrap();
    std::fs::write(bench.path("nan.toml"), "[belt]\nfriction = nan\n").unwrap();
    std::fs::write(bench.path("no.toml"), "this is not TOML").unwrap();
    for (arguments, parts) in [
        (
            &["run", "no-such-scenario"][..],
            &["no-such-scenario", "hybrid-elbow-up"][..],
        ),
        (&["run", "missing.toml"], &["missing.toml"]),
        (&["run", "empty.toml"], &["empty.toml", "is empty"]),
        (&["run", "typo.toml"], &["belt", "fricton", "friction"]),
        (&["run", "nan.toml"], &["belt.friction = NaN", "0 to 10"]),
        (&["run", "no.toml"], &["no.toml", "line 1"]),
        (
            &["--set", "belt.friction=inf"],
            &["belt.friction = inf", "0 to 10"],
        ),
        (
            &["--set", "arm.height_m=0.42"],
            &["arm.height_m = 0.42", "0.00"],
        ),
        (
            &["--set", "belt.colour=red"],
            &["belt.colour", "friction, profile"],
        ),
        (&["--set", "run.duration_s=-1"], &["run.duration_s = -1"]),
        (
            &["--set", "run.duration_s=0.001", "--set", "run.tick_hz=250"],
            &["run.duration_s = 0.001", "0.002 to"],
        ),
        (
            &["--set", "controller.torque_limit_nm=9"],
            &["controller.torque_limit_nm = 9", "0 to 5"],
        ),
        (
            &["plant", "--bus", "b", "--set", "run.tick_hz=1"],
            &["run.tick_hz = 1", "10 to"],
        ),
        (
            &["study", "loop", "--tip=5"],
            &["5 m is out of reach", "0.1841 m"],
        ),
        (
            &["--set", "run.tick_hz=1e9"],
            &["run.tick_hz: ", "from 10 to 100000", "1000000000"],
        ),
    ] {
        assert_refused(&bench, arguments, 2, parts);
    }
}

#[test]
fn a_negative_number_is_refused_by_its_option() {
    let bench = Bench::new("negative");
    for (line, part) in [
        ("run --silence-limit-s -1", "from 0.1 to 86400"),
        ("plant --bus b --wait-s -1", "from 0 to 86400"),
        ("drive --port p --duration -1", "from 0 to 86400"),
        (
            "study robustness --seed -1",
            "from 0 to 18446744073709551615",
        ),
    ] {
        let output = bench.run(&line.split(' ').collect::<Vec<_>>());
        assert_eq!(code(output.status), 2, "{output:?}");
        let message = errors(&output);
        assert!(
            message.contains("'-1'") && message.contains(part),
            "{message}"
        );
    }
}

#[test]
fn outputs_that_cannot_be_written_are_refused_before_anything_is_computed() {
    let bench = Bench::new("output");
    let study = ["study", "regions", "--svg", "/proc/nowhere/x.svg"];
    assert_refused(&bench, &study, 4, &["/proc/nowhere"]);
    for option in ["--record", "--plot"] {
        assert_refused(
            &bench,
            &["run", option, "/proc/nowhere/run"],
            4,
            &["/proc/nowhere"],
        );
    }
    let stdout = ["run", "--no-record", "--no-plot", "--csv", "-"];
    assert_refused(&bench, &stdout, 4, &["`-` cannot be an output file"]);
    let timing = [
        "run",
        "--host",
        "drivers",
        "--timing",
        "/proc/nowhere/t.json",
    ];
    assert_refused(&bench, &timing, 4, &["/proc/nowhere"]);
}

#[test]
fn a_file_that_is_no_image_is_refused() {
    let bench = Bench::new("image");
    for (name, contents) in [("short.toml", &b""[..]), ("text.toml", &[b'x'; 100])] {
        std::fs::write(bench.path(name), contents).unwrap();
        let run = ["run", "--host", "qemu", "--elf", name];
        assert_refused(&bench, &run, 2, &[name, "not an ELF image"]);
    }
}

#[test]
fn a_missing_peer_is_reported_in_time() {
    let bench = Bench::new("missing");
    let alone = |role: &str| {
        let bus = format!("{}-{role}", bench.bus);
        let (output, took) = bench
            .start(&[role, "--bus", &bus])
            .end(Duration::from_secs(30));
        assert_eq!(code(output.status), 3, "{output:?}");
        assert!(errors(&output).contains(&bus), "{output:?}");
        assert!(took < NOTICE, "took {took:?}");
    };
    std::thread::scope(|scope| {
        for role in ["controller", "plant"] {
            scope.spawn(move || alone(role));
        }
    });
    assert!(bench.leftovers().is_empty(), "{:?}", bench.leftovers());
}

#[test]
fn a_second_plant_on_a_bus_is_refused() {
    let bench = Bench::new("two");
    let first = bench.start(&[&LONG[..], &["--bus", &bench.bus]].concat());
    let plant = child_of(first.id(), "plant");
    std::thread::sleep(Duration::from_millis(300));
    let output = bench.run(&["plant", "--bus", &bench.bus, "--no-record", "--no-plot"]);
    assert_eq!(code(output.status), 3, "{output:?}");
    assert!(errors(&output).contains(&bench.bus), "{output:?}");
    assert!(is_running(plant), "the first plant must not suffer");
}

/// Of runs that start on one bus at the same moment, one succeeds, and the others name the bus.
#[test]
fn one_of_several_simultaneous_runs_succeeds() {
    let bench = Bench::new("together");
    let short = [
        "--json",
        "--no-record",
        "--no-plot",
        "--silence-limit-s",
        "20",
    ];
    let hash = bench.report(&[&["run", "--set", "run.duration_s=40"], &short[..]].concat());
    let rounds = std::env::var("PAINLEVE_ROUNDS").map_or(3, |rounds| rounds.parse().unwrap());
    for round in 0..rounds {
        let count = 2 + round % 4;
        let barrier = Barrier::new(count);
        let outputs: Vec<Output> = std::thread::scope(|scope| {
            let start = || {
                let fixed = ["run", "--set", "run.duration_s=40", "--bus", &bench.bus];
                let mut command = bench.command(&[&fixed, &short[..]].concat());
                barrier.wait();
                command.output().unwrap()
            };
            let runs: Vec<_> = (0..count).map(|_| scope.spawn(start)).collect();
            runs.into_iter().map(|run| run.join().unwrap()).collect()
        });
        let (winners, losers): (Vec<_>, Vec<_>) =
            outputs.iter().partition(|output| output.status.success());
        assert_eq!(winners.len(), 1, "round {round}: {outputs:?}");
        let report: Value = serde_json::from_slice(&winners[0].stdout).unwrap();
        assert_eq!(report["log_hash"], hash["log_hash"]);
        for loser in losers {
            assert_eq!(code(loser.status), 3, "{loser:?}");
            let message = format!("error: bus `{}` already has a plant", bench.bus);
            assert!(errors(loser).starts_with(&message), "{loser:?}");
            assert_eq!(errors(loser).trim().lines().count(), 1, "{loser:?}");
        }
    }
    assert!(bench.leftovers().is_empty(), "{:?}", bench.leftovers());
}

/// Kills one process of a run and checks that the others end.
fn kill_and_watch(name: &str, victim: &str, with: Signal) {
    let bench = Bench::new(name);
    let run = bench.start(&[&LONG[..], &["--bus", &bench.bus]].concat());
    let plant = child_of(run.id(), "plant");
    let controller = child_of(run.id(), "controller");
    std::thread::sleep(Duration::from_millis(400));
    let victim_id = match victim {
        "plant" => plant,
        "controller" => controller,
        _ => run.id(),
    };
    signal(victim_id, with);
    let (output, took) = run.end(Duration::from_secs(30));
    assert_ne!(code(output.status), 0, "{output:?}");
    assert!(took < NOTICE, "took {took:?}");
    if victim != "run" {
        assert!(errors(&output).contains("error: "), "{output:?}");
    }
    let start = std::time::Instant::now();
    while (is_running(plant) || is_running(controller)) && start.elapsed() < NOTICE {
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(
        !is_running(plant) && !is_running(controller),
        "left running"
    );
    let visible = bench.files();
    let visible = visible.iter().filter(|file| !file.contains(".part"));
    assert_eq!(visible.count(), 0, "half-written: {:?}", bench.files());

    // The leftovers do not prevent the next run on the same bus.
    let next = bench.report(&[
        "run",
        "--bus",
        &bench.bus,
        "--set",
        "run.duration_s=0.2",
        "--json",
        "--no-record",
        "--no-plot",
    ]);
    assert_eq!(next["ticks"], 200);
    assert!(bench.leftovers().is_empty(), "{:?}", bench.leftovers());
}

#[test]
fn a_killed_controller_ends_the_run() {
    kill_and_watch("kill-controller", "controller", Signal::SIGKILL);
}

#[test]
fn a_killed_plant_ends_the_run() {
    kill_and_watch("kill-plant", "plant", Signal::SIGKILL);
}

#[test]
fn a_stopped_controller_ends_the_run() {
    kill_and_watch("stop-controller", "controller", Signal::SIGSTOP);
}

#[test]
fn killing_a_run_ends_its_processes() {
    kill_and_watch("kill-run", "run", Signal::SIGKILL);
}

/// The kernel forgets with whom a process ends when it starts a program that has more capabilities than its user.
#[test]
fn killing_a_run_with_capabilities_ends_its_processes() {
    const NOBODY: u32 = 65534;
    let bench = Bench::new("capable");
    let copy = bench.path("capable");
    std::fs::copy(program(), &copy).unwrap();
    let mut setcap = Command::new("setcap");
    let capable = setcap.arg("cap_sys_nice+ep").arg(&copy).output();
    if !Uid::effective().is_root() || !capable.is_ok_and(|it| it.status.success()) {
        return skipped("only root can give a program capabilities, with `setcap`");
    }
    chown(bench.path("."), Some(NOBODY), Some(NOBODY)).unwrap();
    let mut run = Command::new("setpriv");
    run.arg(format!("--reuid={NOBODY}"))
        .arg(format!("--regid={NOBODY}"))
        .arg("--clear-groups")
        .arg(&copy)
        .args(LONG)
        .args(["--no-record", "--no-plot"])
        .current_dir(bench.path("."))
        .env("XDG_RUNTIME_DIR", bench.path("."))
        .stdout(Stdio::null());
    let mut run = run.spawn().unwrap();
    let id = run.id().cast_signed();
    let children = ["plant", "controller"].map(|name| child_of(id, name));
    std::thread::sleep(Duration::from_millis(400));
    assert!(children.into_iter().all(is_running));
    signal(id, Signal::SIGKILL);
    run.wait().unwrap();
    let start = std::time::Instant::now();
    while children.into_iter().any(is_running) && start.elapsed() < NOTICE {
        std::thread::sleep(Duration::from_millis(5));
    }
    let left = children.into_iter().filter(|child| is_running(*child));
    let left: Vec<_> = left
        .inspect(|child| signal(*child, Signal::SIGTERM))
        .collect();
    assert!(left.is_empty(), "left running: {left:?}");
}

#[test]
fn ctrl_c_ends_a_run_tidily() {
    let bench = Bench::new("ctrl-c");
    let run = bench.start(&[&LONG[..], &["--bus", &bench.bus]].concat());
    let plant = child_of(run.id(), "plant");
    let controller = child_of(run.id(), "controller");
    std::thread::sleep(Duration::from_millis(400));
    for id in [run.id(), plant, controller] {
        signal(id, Signal::SIGINT);
    }
    let (output, _) = run.end(Duration::from_secs(30));
    assert_eq!(code(output.status), 130, "{output:?}");
    assert_eq!(bench.files(), ["out/run.partial.mcap"], "{output:?}");
    let record = std::fs::read(bench.path("out/run.partial.mcap")).unwrap();
    let summary = mcap::Summary::read(&record).unwrap().unwrap();
    assert!(summary.stats.unwrap().message_count > 0);
    assert_eq!(
        errors(&output).matches("interrupted").count(),
        1,
        "{output:?}"
    );
    assert!(!is_running(plant) && !is_running(controller));
    assert!(bench.leftovers().is_empty(), "{:?}", bench.leftovers());
}

/// The plant has ended its ticks, and completes its files whatever it is asked.
#[test]
fn ctrl_c_while_the_last_figure_is_written_does_not_undo_the_run() {
    let bench = Bench::new("late");
    let converter = "#!/bin/sh\n[ $1 = --version ] && exit\ncat > given\nsleep 1.5\necho figure\n";
    std::fs::write(bench.path("rsvg-convert"), converter).unwrap();
    let executable = std::fs::Permissions::from_mode(0o755);
    std::fs::set_permissions(bench.path("rsvg-convert"), executable).unwrap();
    let short = ["--set", "run.duration_s=0.05", "--no-record", "--no-html"];
    let mut run = bench.command(&[&["run", "--plot", "run.png"], &short[..]].concat());
    let path = std::env::var("PATH").unwrap();
    run.env("PATH", format!("{}:{path}", bench.path("").display()));
    let run = run.stdout(Stdio::null()).spawn().unwrap();
    while !bench.path("given").exists() && is_running(run.id().cast_signed()) {
        std::thread::sleep(Duration::from_millis(1));
    }
    signal(run.id().cast_signed(), Signal::SIGINT);
    let output = run.wait_with_output().unwrap();
    assert_eq!(code(output.status), 0, "{output:?}");
    assert_eq!(std::fs::read(bench.path("run.png")).unwrap(), b"figure\n");
}

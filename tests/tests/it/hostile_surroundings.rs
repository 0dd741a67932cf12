//! Closed pipes, full disks, folders of other users, signals at inconvenient times and special
//! files give one message, the correct exit code and no leftovers.

use std::fs::{self, File};
use std::io::Write;
use std::os::unix::fs::{FileExt, MetadataExt, PermissionsExt};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use nix::sys::signal::Signal;
use nix::sys::stat::Mode;
use nix::unistd::mkfifo;
use painleve_tests::{Bench, Running, child_of, code, errors, is_running, signal};
use serde_json::Value;

const SOON: Duration = Duration::from_secs(5);
const SHORT: [&str; 5] = [
    "--set",
    "run.duration_s=0.05",
    "--no-record",
    "--no-plot",
    "--json",
];

#[test]
fn a_closed_pipe_is_not_an_error_but_a_full_disk_is() {
    let bench = Bench::new("stdout");
    for arguments in ["scenarios", "run --set run.duration_s=0.05 --json"] {
        let unread = bench.shell(&format!("$P {arguments} | true; exit ${{PIPESTATUS[0]}}"));
        assert_eq!(code(unread.status), 0, "{arguments}: {unread:?}");
        assert_eq!(errors(&unread), "", "{arguments}");
        let full = bench.shell(&format!("$P {arguments} > /dev/full"));
        assert_eq!(code(full.status), 4, "{arguments}: {full:?}");
        assert!(errors(&full).contains("stdout"), "{full:?}");
    }
    // An unwritable log must not end a run.
    let line = format!("$P run --pacing realtime {} 2>/dev/full", SHORT.join(" "));
    let unlogged = bench.shell(&line);
    assert_eq!(code(unlogged.status), 0, "{unlogged:?}");
}

#[test]
fn help_and_usage_are_ascii_where_the_locale_asks_for_it() {
    let bench = Bench::new("ascii");
    for (arguments, expected) in [
        (["commission", "--torque-limit-nm=nan"], 2),
        (["commission", "--help"], 0),
    ] {
        let mut command = bench.command(&arguments);
        let output = command.env("LC_ALL", "C").output().unwrap();
        assert_eq!(code(output.status), expected, "{output:?}");
        assert!(output.stdout.is_ascii(), "{output:?}");
        assert!(output.stderr.is_ascii(), "{output:?}");
        assert!(output.stdout.len() + output.stderr.len() > 60, "{output:?}");
    }
}

#[test]
fn signals_are_handled_while_a_process_waits_for_its_peer() {
    let interrupted = |role: &str, sent: Signal| {
        let bench = Bench::new(&format!("waiting-{role}-{sent}"));
        let running = bench.start(&[role, "--bus", &bench.bus, "--wait-s", "60"]);
        std::thread::sleep(Duration::from_millis(300));
        signal(running.id(), sent);
        let (output, took) = running.end(SOON);
        assert_eq!(code(output.status), 130, "{output:?}");
        assert_eq!(errors(&output), "error: interrupted\n");
        assert!(took < Duration::from_secs(2), "{took:?}");
        assert_eq!(bench.files(), [""; 0]);
    };
    std::thread::scope(|scope| {
        for role in ["plant", "controller"] {
            for sent in [Signal::SIGINT, Signal::SIGTERM] {
                scope.spawn(move || interrupted(role, sent));
            }
        }
    });
}

#[test]
fn a_process_stopped_during_its_start_is_detected() {
    let stopped = |role: &str| {
        let bench = Bench::new(&format!("stopped-{role}"));
        let long = ["run", "--bus", &bench.bus, "--set", "run.duration_s=100000"];
        let running = bench.start(&long);
        let id = child_of(running.id(), role);
        signal(id, Signal::SIGSTOP);
        let start = Instant::now();
        let (output, _) = running.end(SOON);
        assert_eq!(code(output.status), 3, "{output:?}");
        // Two seconds for detection, one for cleaning up.
        assert!(
            start.elapsed() < Duration::from_secs(4),
            "{:?}",
            start.elapsed()
        );
        assert_eq!(errors(&output).matches("error: ").count(), 1, "{output:?}");
    };
    std::thread::scope(|scope| {
        for role in ["controller", "plant"] {
            scope.spawn(move || stopped(role));
        }
    });
}

/// A wall clock that is a day off in one direction or the other, by turns at each reading.
const UNSTEADY_CLOCK: &str = r"
#define _GNU_SOURCE
#include <sys/syscall.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>
int clock_gettime(clockid_t clock, struct timespec *now) {
    static int readings;
    int failed = syscall(SYS_clock_gettime, clock, now);
    if (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE)
        now->tv_sec += readings++ % 2 ? 86400 : -86400;
    return failed;
}
int gettimeofday(struct timeval *now, void *zone) {
    struct timespec time;
    (void)zone;
    clock_gettime(CLOCK_REALTIME, &time);
    now->tv_sec = time.tv_sec;
    now->tv_usec = time.tv_nsec / 1000;
    return 0;
}
time_t time(time_t *now) {
    struct timespec time;
    clock_gettime(CLOCK_REALTIME, &time);
    return now ? *now = time.tv_sec : time.tv_sec;
}
";

#[test]
fn steps_of_the_wall_clock_disturb_neither_pacing_nor_patience() {
    let bench = Bench::new("wall-clock");
    fs::write(bench.path("clock.c"), UNSTEADY_CLOCK).unwrap();
    let compiled = Command::new("cc")
        .args(["-shared", "-fPIC", "-o", "clock.so", "clock.c"])
        .current_dir(bench.path(""))
        .status();
    assert!(compiled.unwrap().success());
    let unsteady = |mut command: Command| {
        command.env("LD_PRELOAD", bench.path("clock.so"));
        let start = Instant::now();
        (command.output().unwrap(), start.elapsed())
    };
    // The clock is indeed a day off.
    let mut date = Command::new("date");
    date.arg("+%s");
    let said = String::from_utf8(unsteady(date).0.stdout).unwrap();
    let now = fs::metadata(bench.path("clock.so")).unwrap().mtime();
    assert!((said.trim().parse::<i64>().unwrap() - now).abs() > 80_000);

    let slow = ["run.tick_hz=50", "controller.estimator.bandwidth_rad_s=100"];
    let mut run = vec![
        "run",
        "--pacing",
        "realtime",
        "--json",
        "--no-record",
        "--no-plot",
    ];
    for key in slow.iter().chain(&["run.duration_s=1"]) {
        run.extend(["--set", key]);
    }
    let (output, took) = unsteady(bench.command(&run));
    assert_eq!(code(output.status), 0, "{}", errors(&output));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["ticks"], 50);
    let factor = report["realtime_factor"].as_f64().unwrap();
    assert!((0.9..1.1).contains(&factor), "{factor}");
    assert!(took < Duration::from_secs(10), "{took:?}");

    let waits_alone = |what| {
        let bench = Bench::new(what);
        let (output, took) = unsteady(bench.command(&[what, "--bus", &bench.bus]));
        assert_eq!(code(output.status), 3, "{}", errors(&output));
        let waited = Duration::from_millis(1500)..Duration::from_secs(10);
        assert!(waited.contains(&took), "{took:?}");
    };
    std::thread::scope(|scope| {
        for what in ["plant", "controller"] {
            scope.spawn(move || waits_alone(what));
        }
    });
}

#[test]
fn child_output_may_exceed_the_capacity_of_a_pipe() {
    let bench = Bench::new("pipe");
    let name = "x".repeat(70_000);
    let report = bench.report(&[&["--set", &format!("name={name}")], &SHORT[..]].concat());
    assert_eq!(report["scenario"], Value::from(name));

    let mut chatty = bench.command(&[&["run"], &SHORT[..]].concat());
    let output = chatty.env("IOX2_LOG_LEVEL", "trace").output().unwrap();
    assert_eq!(code(output.status), 0, "{}", errors(&output));
}

#[test]
fn settings_beyond_all_bounds_are_refused_at_once() {
    let bench = Bench::new("bounds");
    let deep = format!("{}=1", vec!["a"; 60_000].join("."));
    fs::write(bench.path("deep.toml"), &deep).unwrap();
    fs::write(
        bench.path("nested.toml"),
        format!("a={}", "[".repeat(60_000)),
    )
    .unwrap();
    mkfifo(&bench.path("pipe.toml"), Mode::S_IRWXU).unwrap();
    let cells = [
        "study",
        "bifurcation",
        "--mu",
        "0:1:1e-6",
        "--v-belt",
        "-1:0:1e-6",
    ];
    for (arguments, part) in [
        (&["run", "--set", &deep][..], "levels"),
        (&["run", "deep.toml"], "deep.toml"),
        (&["run", "nested.toml"], "nested.toml"),
        (&["run", "pipe.toml"], "not a regular file"),
        (&["run", "/dev/zero"], "not a regular file"),
        (
            &["run", "--set", "belt.friction=0.4\nrun.seed=7"],
            "key=value",
        ),
        (
            &["run", "--set", "solver.chatter_speed_m_s=1e-8"],
            "chatter_speed",
        ),
        (&["run", "--record", "same", "--plot", "./same"], "same"),
        (&cells, "at most"),
        (&["study", "bifurcation", "--mu", "0:1e308:1e302"], "1e302"),
    ] {
        let start = Instant::now();
        let (output, took) = bench.start(arguments).end(Duration::from_secs(20));
        assert_eq!(code(output.status), 2, "{part}: {}", errors(&output));
        let message = errors(&output);
        assert!(message.contains(part), "'{part}' is not in: {message:.200}");
        assert!(took < SOON, "{part}: {:?}", start.elapsed());
    }
}

#[test]
fn one_of_two_simultaneously_planned_sweeps_is_refused() {
    let bench = Bench::new("plans");
    for mu in ["0.4", "0.6"] {
        let campaign = format!("study = \"bifurcation\"\nmu = \"{mu}\"\nv-belt = \"-0.4\"\n");
        fs::write(bench.path(&format!("{mu}.toml")), campaign).unwrap();
    }
    for round in 0..10 {
        let folder = format!("sweep-{round}");
        let plan = |mu: &str| {
            let campaign = format!("{mu}.toml");
            bench.start(&[
                "sweep", "plan", &campaign, "--shards", "1", "--folder", &folder,
            ])
        };
        let both = [plan("0.4"), plan("0.6")];
        let mut codes = both.map(|running| code(running.end(SOON).0.status));
        codes.sort_unstable();
        assert_eq!(codes, [0, 2], "round {round}");
    }
}

#[test]
fn interrupted_studies_and_figures_end_with_their_exit_code_and_leave_nothing() {
    let bench = Bench::new("batch");
    for arguments in [
        &[
            "study",
            "robustness",
            "--runs",
            "100000",
            "--csv",
            "rows.csv",
        ][..],
        &["figures", "--out", "figures"],
    ] {
        let running = bench.start(arguments);
        std::thread::sleep(Duration::from_millis(700));
        signal(running.id(), Signal::SIGTERM);
        let (output, _) = running.end(SOON);
        assert_eq!(code(output.status), 130, "{output:?}");
        assert_eq!(errors(&output), "error: interrupted\n");
        assert_eq!(bench.files(), [""; 0]);
    }
}

#[test]
fn an_interrupted_rehearsal_ends_with_its_exit_code_and_leaves_nothing() {
    // That of `commission` ends too soon for a signal.
    for sent in [Signal::SIGTERM, Signal::SIGINT, Signal::SIGHUP] {
        let bench = Bench::new("rehearsal");
        let running = bench.start(&["identify", "edge", "--rehearse"]);
        std::thread::sleep(Duration::from_millis(300));
        signal(running.id(), sent);
        let (output, _) = running.end(SOON);
        assert_eq!(code(output.status), 130, "{sent}: {output:?}");
        assert_eq!(errors(&output), "error: interrupted\n");
        assert_eq!(bench.files(), [""; 0]);
    }
}

#[test]
fn a_study_interrupted_while_its_figure_is_converted_leaves_neither_files_nor_the_converter() {
    let bench = Bench::new("converter");
    let converter =
        "#!/bin/sh\n[ $1 = --version ] && exit\necho $$ > new\nmv new id\nexec sleep 60\n";
    fs::write(bench.path("rsvg-convert"), converter).unwrap();
    let executable = fs::Permissions::from_mode(0o755);
    fs::set_permissions(bench.path("rsvg-convert"), executable).unwrap();
    let line = "study bifurcation --mu 0.6 --v-belt=-0.4 --initial a --csv a.csv --svg x.png";
    let mut study = bench.command(&line.split_whitespace().collect::<Vec<_>>());
    let path = std::env::var("PATH").unwrap();
    study.env("PATH", format!("{}:{path}", bench.path("").display()));
    let study = study.stderr(Stdio::piped()).spawn().unwrap();
    while !bench.path("id").exists() && is_running(study.id().cast_signed()) {
        std::thread::sleep(Duration::from_millis(1));
    }
    signal(study.id().cast_signed(), Signal::SIGTERM);
    let output = study.wait_with_output().unwrap();
    assert_eq!(code(output.status), 130, "{output:?}");
    assert_eq!(bench.files(), ["id", "rsvg-convert"]);
    let id = fs::read_to_string(bench.path("id")).unwrap();
    let id = id.trim().parse().unwrap();
    let start = Instant::now();
    while is_running(id) {
        assert!(start.elapsed() < SOON, "the converter still runs");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// The disk takes the folder of the costs away while the run goes on.
#[test]
fn costs_that_cannot_be_written_at_the_end_of_a_run_end_it_with_the_code_of_outputs() {
    let bench = Bench::new("costs");
    fs::create_dir(bench.path("t")).unwrap();
    let line =
        "run edge --host drivers --set run.duration_s=100 --no-record --no-plot --timing t/t.json";
    let running = bench.start(&line.split_whitespace().collect::<Vec<_>>());
    child_of(running.id(), "bridge");
    let start = Instant::now();
    // The bridge may create the folder once more as it starts.
    while fs::remove_dir_all(bench.path("t")).is_err()
        || fs::write(bench.path("t"), "a file").is_err()
    {
        assert!(start.elapsed() < SOON, "the folder comes back");
    }
    let (output, _) = running.end(Duration::from_secs(60));
    assert_eq!(code(output.status), 4, "{output:?}");
    assert!(errors(&output).contains("t/t.json"), "{output:?}");
    assert_eq!(errors(&output).matches("error: ").count(), 1, "{output:?}");
}

#[test]
fn an_interrupted_export_leaves_nothing() {
    let bench = Bench::new("export");
    let recorded = bench.run(&[
        "run",
        "--set",
        "run.duration_s=20",
        "--no-plot",
        "--record",
        "run.mcap",
    ]);
    assert_eq!(code(recorded.status), 0, "{recorded:?}");
    let before = bench.files();
    for format in ["--csv=new.csv", "--ros2=new.mcap"] {
        let running = bench.start(&["export", "run.mcap", format]);
        let is_written = || bench.files().len() > before.len();
        interrupt_once(running, is_written);
        assert_eq!(bench.files(), before);
    }
}

/// Interrupts a command at work, as Ctrl-C does.
fn interrupt_once(running: Running, is_at_work: impl Fn() -> bool) {
    while !is_at_work() && is_running(running.id()) {
        std::thread::sleep(Duration::from_millis(1));
    }
    signal(running.id(), Signal::SIGINT);
    let (output, _) = running.end(SOON);
    assert_eq!(code(output.status), 130, "{output:?}");
    assert_eq!(errors(&output), "error: interrupted\n");
}

#[test]
fn an_export_that_finds_nothing_to_write_can_be_interrupted() {
    let bench = Bench::new("foreign-export");
    let path = bench.path("foreign.mcap");
    let file = File::create(&path).unwrap();
    let record = |kind: u8, content: &[u8]| {
        let length = (content.len() as u64).to_le_bytes();
        [&[kind][..], &length, content].concat()
    };
    let header = record(1, &[0; 8]);
    // Channel 0 of the topic "a".
    let channel = record(4, b"\0\0\0\0\x01\0\0\0a\0\0\0\0\0\0\0\0");
    let head = [&b"\x89MCAP0\r\n"[..], &header, &channel].concat();
    file.write_all_at(&head, 0).unwrap();
    // Its messages are holes in the file, which take a minute to read.
    let length = 4_u64 << 20;
    for message in 0..20_000 {
        let start = [&[5][..], &length.to_le_bytes()].concat();
        let at = head.len() as u64 + message * (start.len() as u64 + length);
        file.write_all_at(&start, at).unwrap();
    }
    for format in ["--csv=new.csv", "--ros2=new.mcap"] {
        let running = bench.start(&["export", "foreign.mcap", format]);
        let descriptors = format!("/proc/{}/fd", running.id());
        let is_read = || {
            let open = fs::read_dir(&descriptors).into_iter().flatten().flatten();
            let mut files = open.filter_map(|it| fs::read_link(it.path()).ok());
            files.any(|file| file == path)
        };
        interrupt_once(running, is_read);
        assert_eq!(bench.files(), ["foreign.mcap"]);
    }
}

#[test]
fn a_runtime_folder_of_another_user_is_not_used() {
    let bench = Bench::new("foreign");
    // A world-writable folder is skipped.
    let open = bench.path("open");
    fs::create_dir(&open).unwrap();
    fs::set_permissions(&open, fs::Permissions::from_mode(0o777)).unwrap();
    let mut run = bench.command(&[&["run"], &SHORT[..]].concat());
    let output = run.env("XDG_RUNTIME_DIR", &open).output().unwrap();
    assert_eq!(code(output.status), 0, "{output:?}");
    assert_eq!(fs::read_dir(&open).unwrap().count(), 0);

    // A file is in place of the program's own folder.
    let blocked = bench.path("blocked");
    fs::create_dir(&blocked).unwrap();
    fs::set_permissions(&blocked, fs::Permissions::from_mode(0o700)).unwrap();
    File::create(blocked.join("painleve"))
        .unwrap()
        .write_all(b"x")
        .unwrap();
    let mut plant = bench.command(&["controller", "--bus", &bench.bus]);
    plant
        .env("XDG_RUNTIME_DIR", &blocked)
        .stderr(Stdio::piped());
    let output = plant.output().unwrap();
    assert_eq!(code(output.status), 3, "{output:?}");
    assert!(errors(&output).contains("blocked/painleve"), "{output:?}");
}

#[test]
fn a_runtime_folder_that_iceoryx2_cannot_use_is_refused_by_its_path() {
    let bench = Bench::new("odd-runtime");
    for name in ["ü", &"long".repeat(30)] {
        let folder = bench.path(name);
        fs::create_dir(&folder).unwrap();
        fs::set_permissions(&folder, fs::Permissions::from_mode(0o700)).unwrap();
        let mut run = bench.command(&[&["run"], &SHORT[..]].concat());
        let output = run.env("XDG_RUNTIME_DIR", &folder).output().unwrap();
        assert_eq!(code(output.status), 3, "{output:?}");
        let message = errors(&output);
        assert!(
            message.contains(&format!("{name}/painleve/"))
                && message.contains("its path is too long or not ASCII; set XDG_RUNTIME_DIR"),
            "{message}"
        );
    }
}

#[test]
fn the_watchdog_removes_the_torque_of_a_plant_without_commands() {
    let bench = Bench::new("watchdog");
    // With this frame loss, 10 ticks without a command soon occur.
    let report = bench.report(&[
        "run",
        "--json",
        "--record",
        "run.mcap",
        "--no-plot",
        "--set",
        "converters.link.frame_loss=0.7",
        "--set",
        "converters.torque.watchdog_ticks=10",
    ]);
    let off_s = report["drive_watchdog_s"].as_f64().unwrap();
    let export = bench.run(&["export", "run.mcap", "--csv", "run.csv"]);
    assert!(export.status.success(), "{}", errors(&export));
    let table = std::fs::read_to_string(bench.path("run.csv")).unwrap();
    let mut lines = table
        .lines()
        .map(|line| line.split(',').collect::<Vec<_>>());
    let names = lines.next().unwrap();
    let column = |name| names.iter().position(|it| *it == name).unwrap();
    let [time, u1, u2] = ["time_s", "plant.u1_nm", "plant.u2_nm"].map(column);
    let after: Vec<_> = lines
        .filter(|line| line[time].parse::<f64>().unwrap() > off_s)
        .collect();
    assert!(after.len() > 100, "{}", after.len());
    for line in after {
        assert_eq!((line[u1], line[u2]), ("0.0", "0.0"), "{line:?}");
    }
}

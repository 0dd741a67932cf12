//! The controller's image on the emulated microcontroller gives exactly the same counts as the
//! controller on this machine, in every run and within the budget of instructions and stack in
//! `budget.json`.

// Helper functions of tests may panic as tests do.
#![allow(clippy::unwrap_used)]

use std::fs::Permissions;
use std::io::Write;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use nix::sys::signal::Signal;
use object::elf::{FileHeader32, PT_LOAD};
use object::read::elf::{FileHeader, ProgramHeader};
use object::{Endianness, Object, ObjectSection};
use painleve_board::timing::{TickTimes, TimingReport};
use painleve_board::{ConnectedBoard, Emulator};
use painleve_plant::closed_loop::ClosedLoop;
use painleve_plant::controller_host::{Answer, ControllerHost, HostError};
use painleve_plant::scenario::{Scenario, built_in};
use painleve_plant::simulation::Simulation;
use painleve_plant::{Configuration, Controller};
use painleve_shared::counts::TorqueCounts;
use painleve_shared::frame::{ActuatorFrame, DigitalInputs, SensorFrame};
use painleve_shared::message::Health;
use painleve_shared::status::{Fault, SupervisorState};
use painleve_tests::printed::{self, LastFigure, thousands};
use painleve_tests::{Bench, child_of, errors, image, is_running, signal};

/// Sends every frame to both controllers and compares their answers.
struct Both {
    native: Controller,
    emulated: Emulator,
    times: TickTimes,
    scenario: String,
}

impl Both {
    fn new(scenario: &Scenario) -> Self {
        let configuration: Configuration = scenario.controller_configuration();
        Self {
            native: Controller::new(&configuration).expect("built in"),
            emulated: Emulator::start(image(), &configuration, false, BUSY).expect("QEMU starts"),
            times: TickTimes::default(),
            scenario: scenario.name.clone(),
        }
    }
}

impl ControllerHost for Both {
    fn exchange(&mut self, sensor: &SensorFrame) -> Result<Answer, HostError> {
        let start = Instant::now();
        let before = self.native.clone();
        let native = self.native.tick(sensor);
        let answer = self.emulated.exchange(sensor).expect("the image answers");
        self.times.push(&answer.frame, answer.cost);
        let emulated = answer.frame;
        assert!(
            native == emulated,
            "{}: the image differs first at tick {}\n\
             sensor frame {sensor:?}\n\
             native   answer {native:?}\n\
             emulated answer {emulated:?}\n\
             native   state {:?}, latched {:?}\n\
             emulated state {:?}, latched {:?}\n\
             native controller before {before:#?}",
            self.scenario,
            sensor.tick,
            native.supervisor_state(),
            native.latched_fault(),
            emulated.supervisor_state(),
            emulated.latched_fault(),
        );
        Ok(Answer {
            frame: Some(native),
            round_trip: Some(start.elapsed()),
        })
    }
}

fn budget() -> serde_json::Value {
    serde_json::from_str(include_str!("../../budget.json")).expect("valid JSON")
}

/// Ticks that are executed of a longer scenario.
const MOST_TICKS: u64 = 10_000;

/// Runs a scenario on both and checks for equal counts within the budget for `key`. Returns the
/// scenario's row of the documentation, and the bytes of stack.
fn equal_within_budget(name: &str, overrides: &[String], key: &str) -> (String, u32) {
    let budget = budget();
    let scenario = Scenario::load(name, overrides).unwrap();
    let simulation = Simulation::new(&scenario).unwrap();
    let mut closed_loop = ClosedLoop::new(simulation, Both::new(&scenario));
    let ticks = scenario.run.ticks().min(MOST_TICKS);
    for _ in 0..ticks {
        closed_loop.tick(&mut ()).unwrap();
    }
    let (_, mut both) = closed_loop.finish();
    let tick_hz = scenario.run.tick_hz;
    let report = TimingReport::of_board(name, tick_hz, &both.times, &mut both.emulated);
    let report = report.unwrap();
    let stack_bytes = report.stack_bytes.unwrap();
    let health = report.board.unwrap();
    let nothing_else = Health {
        stack_bytes,
        ticks: ticks as u32,
        ..Default::default()
    };
    assert_eq!(health, nothing_else, "{name}");
    let most = budget[key].as_u64().unwrap();
    assert!(
        u64::from(report.max) <= most,
        "{name}: more than the {most} instructions of budget.json: {:?}",
        report.worst,
    );
    assert!(
        u64::from(stack_bytes) <= budget["stack_bytes"].as_u64().unwrap(),
        "{name}: {stack_bytes} bytes of stack are more than budget.json allows",
    );
    let [median, max, most] = [report.median.into(), report.max.into(), most].map(thousands);
    let row = format!("| `{name}` | {median} | {max} | {most} |\n");
    (row, stack_bytes)
}

const HEADER: &str = "| scenario | median | worst tick | limit |\n|---|---|---|---|\n";

#[test]
fn the_image_answers_every_built_in_scenario_with_the_same_counts_within_budget() {
    let (rows, stacks): (String, Vec<u32>) = built_in::names()
        .map(|name| equal_within_budget(name, &[], "worst_tick_instructions"))
        .unzip();
    printed::check(
        "flashing.md",
        "ticks",
        &format!("{HEADER}{rows}"),
        LastFigure::Limit,
    );
    let stack = u64::from(stacks.into_iter().max().unwrap());
    let limit = budget()["stack_bytes"].as_u64().unwrap();
    let [stack, limit] = [stack, limit].map(thousands);
    let row = format!("| stack, maximum over all scenarios | {stack} | {limit} |");
    printed::check_row("flashing.md", &row);
}

#[test]
fn the_image_detects_contact_from_the_encoders_with_the_same_counts_within_budget() {
    let encoders = ["controller.contact.evidence=encoders".to_string()];
    let key = "worst_tick_instructions_from_encoders";
    let rows = ["edge", "capture"].map(|name| equal_within_budget(name, &encoders, key).0);
    let expected = format!("{HEADER}{}", rows.concat());
    printed::check(
        "flashing.md",
        "ticks from encoders",
        &expected,
        LastFigure::Limit,
    );
}

/// Two consecutive overruns in the middle of a run.
#[test]
fn overload_latches_a_fault_without_torque_in_the_same_tick_until_rearming() {
    let scenario = Scenario::default();
    let configuration = scenario.controller_configuration();
    let mut simulation = Simulation::new(&scenario).unwrap();
    let mut board = Emulator::start(image(), &configuration, false, BUSY).unwrap();
    let mut tick = |inputs: DigitalInputs| -> ActuatorFrame {
        let mut frame = simulation.sample(&mut ()).unwrap();
        frame.inputs = inputs;
        let answer = board.exchange(&frame).unwrap().frame;
        simulation.advance(Some(&answer), &mut ()).unwrap();
        answer
    };
    let on = DigitalInputs::ENABLE;
    let overload = on | DigitalInputs::OVERLOAD;
    let no_torque = [TorqueCounts(0); 2];
    for _ in 0..50 {
        assert_eq!(tick(on).latched_fault(), None);
    }
    // One overrun is tolerated, and two ticks in time make up for it.
    for inputs in [overload, on, on, overload] {
        let answer = tick(inputs);
        assert_eq!(answer.supervisor_state(), Some(SupervisorState::Tracking));
        assert_ne!(answer.torques, no_torque);
    }
    let stopped = tick(overload);
    assert_eq!(stopped.latched_fault(), Some(Fault::Overrun));
    assert_eq!(stopped.torques, no_torque);
    for inputs in [on, DigitalInputs::default(), on] {
        let answer = tick(inputs);
        assert_eq!(answer.latched_fault(), Some(Fault::Overrun));
        assert_eq!(answer.torques, no_torque);
    }
    let reset = tick(on | DigitalInputs::RESET);
    assert_eq!(reset.supervisor_state(), Some(SupervisorState::Idle));
    assert_eq!(tick(on).torques, no_torque, "a reset alone arms nothing");
    tick(DigitalInputs::default());
    let armed = tick(on);
    assert_eq!(armed.supervisor_state(), Some(SupervisorState::Armed));
    assert_ne!(armed.torques, no_torque);
    assert_eq!(board.health().unwrap().lapses.overruns, 3);
}

/// Longest silence of the image on a machine that is busy with other tests.
const BUSY: Duration = Duration::from_secs(20);
/// On a busy machine the emulator may stand still for seconds.
const SHORT: [&str; 4] = ["--set", "run.duration_s=1.0", "--silence-limit-s", "30"];
const QUIET: [&str; 3] = ["--json", "--no-record", "--no-plot"];

#[test]
fn runs_as_processes_agree_and_repeat_to_the_instruction() {
    let bench = Bench::new("pil");
    let image = image().to_string_lossy();
    let native = bench.report(&[&["run"], &SHORT[..], &QUIET[..]].concat());
    let mut timings = Vec::new();
    for _ in 0..3 {
        let qemu = [
            "run", "--host", "qemu", "--elf", &image, "--timing", "t.json",
        ];
        let report = bench.report(&[&qemu[..], &SHORT[..], &QUIET[..]].concat());
        assert_eq!(report["host"], "qemu");
        assert_eq!(report["log_hash"], native["log_hash"]);
        timings.push(std::fs::read_to_string(bench.path("t.json")).unwrap());
    }
    assert_eq!(timings[0], timings[1]);
    assert_eq!(timings[0], timings[2]);
}

/// Whole, as a user runs them. At 10 kHz, as `paper-gains` asks for, the emulator is slower than real time.
#[test]
#[ignore = "measures time, so it needs a quiet machine"]
fn every_built_in_scenario_runs_as_natively_and_at_1_khz_three_times_as_fast_as_real_time() {
    let bench = Bench::new("qemu-speed");
    let image = image().to_string_lossy();
    for name in built_in::names() {
        let native = bench.report(&[&["run", name], &QUIET[..]].concat());
        let qemu = ["run", name, "--host", "qemu", "--elf", &image];
        let report = bench.report(&[&qemu[..], &QUIET[..]].concat());
        assert_eq!(report["log_hash"], native["log_hash"], "{name}");
        let factor = report["realtime_factor"].as_f64().unwrap();
        println!("{name}: {factor:.1} × real time");
        let is_slow = Scenario::load(name, &[]).unwrap().run.tick_hz <= 1000;
        assert!(factor >= 3.0 || !is_slow, "{name}: {factor}");
    }
}

#[test]
fn timing_gives_the_same_report_for_every_host() {
    let bench = Bench::new("timing");
    let image = image().to_string_lossy();
    let short = ["--set", "run.duration_s=0.1", "--svg", "t.svg", "--json"];
    let both = ["pid-elbow-up", "paper-gains"];
    for (host, unit) in [
        (&["--elf", &image][..], "instructions"),
        (&["--host", "native"], "nanoseconds"),
    ] {
        let reports = bench.report(&[&["timing"], &both[..], host, &short].concat());
        let reports = reports.as_array().unwrap();
        assert_eq!(reports.len(), 2);
        for (report, (name, ticks)) in reports.iter().zip(both.iter().zip([100, 1000])) {
            assert_eq!(report["scenario"], *name);
            assert_eq!(report["ticks"], ticks);
            assert_eq!(report["unit"], unit);
            let cost = |key: &str| report[key].as_u64().unwrap();
            let order = ["min", "median", "p999", "max"].map(cost);
            assert!(order.is_sorted(), "{report}");
            assert_eq!(report["worst"]["cost"], order[3]);
            let ticks_of = |pair: &serde_json::Value| pair[1].as_u64().unwrap();
            let counted: u64 = report["histogram"]
                .as_array()
                .unwrap()
                .iter()
                .map(ticks_of)
                .sum();
            assert_eq!(counted, ticks);
        }
        let figure = std::fs::read_to_string(bench.path("t.svg")).unwrap();
        assert!(figure.contains("paper-gains, 10000 Hz"), "{host:?}");
    }
}

/// What the emulator has in its flash after a run is what is flashed: the emulator executes no other bytes.
#[test]
fn the_emulator_executes_the_bytes_that_are_flashed() {
    const FLASH: u32 = 0x0800_0000;
    const LENGTH: usize = 1 << 20;
    let bench = Bench::new("flashed-bytes");
    let copy = bench.path("flash.bin");
    let mut emulator = Command::new("qemu-system-arm")
        .args(["-machine", "netduinoplus2", "-display", "none"])
        .args(["-nodefaults", "-monitor", "stdio"])
        .args(["-semihosting-config", "enable=on,target=native"])
        .arg("-kernel")
        .arg(image())
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let save = format!("pmemsave {FLASH} {LENGTH} \"{}\"\nquit\n", copy.display());
    emulator
        .stdin
        .take()
        .unwrap()
        .write_all(save.as_bytes())
        .unwrap();
    assert!(emulator.wait().unwrap().success());
    let executed = std::fs::read(copy).unwrap();
    assert_eq!(executed.len(), LENGTH);

    let file = std::fs::read(image()).unwrap();
    let header = FileHeader32::<Endianness>::parse(&*file).unwrap();
    let endian = header.endian().unwrap();
    let mut flashed = vec![0; LENGTH];
    for segment in header.program_headers(endian, &*file).unwrap() {
        let bytes = segment.data(endian, &*file).unwrap();
        if segment.p_type(endian) == PT_LOAD && !bytes.is_empty() {
            let start = (segment.p_paddr(endian) - FLASH) as usize;
            flashed[start..start + bytes.len()].copy_from_slice(bytes);
        }
    }
    let differs = executed.iter().zip(&flashed).position(|(a, b)| a != b);
    assert_eq!(differs, None, "bytes of flash that differ");
    // The program is where the chip's remapped memory has it, too.
    assert_eq!(flashed[0x400..0x800], program_section(&file)[..0x400]);
}

/// Returns the section that the chip copies to its memory, where it is executed.
fn program_section(file: &[u8]) -> Vec<u8> {
    let image = object::File::parse(file).unwrap();
    let section = image.section_by_name(".program").unwrap();
    assert_eq!(section.address(), 0x400);
    section.data().unwrap().to_vec()
}

/// Whatever an emulator made there would stay if its bridge were killed.
#[test]
fn the_emulator_makes_no_temporary_files() {
    let bench = Bench::new("no-temporary-files");
    let image = image().to_string_lossy();
    let qemu = ["run", "--host", "qemu", "--elf", &image];
    let output = bench
        .command(&[&qemu[..], &SHORT, &QUIET].concat())
        .env("TMPDIR", "/nowhere")
        .output()
        .unwrap();
    assert!(output.status.success(), "{output:?}");
}

#[test]
fn the_error_about_a_missing_image_names_the_build_command() {
    let bench = Bench::new("no-image");
    let qemu = ["run", "--host", "qemu", "--elf", "/nowhere/image"];
    let output = bench.run(&[&qemu[..], &QUIET[..]].concat());
    let text = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(3), "{text}");
    assert!(text.contains("cargo xtask build-fw"), "{text}");
}

/// The path of QEMU.
fn qemu() -> String {
    let found = Command::new("/bin/sh")
        .args(["-c", "command -v qemu-system-arm"])
        .output()
        .unwrap();
    String::from_utf8(found.stdout).unwrap().trim_end().into()
}

/// Writes a shell script.
fn script(path: &Path, text: &str) {
    std::fs::write(path, format!("#!/bin/sh\n{text}\n")).unwrap();
    std::fs::set_permissions(path, Permissions::from_mode(0o755)).unwrap();
}

/// A first start reads QEMU from the disk.
#[test]
fn a_slow_start_of_qemu_is_no_silence_of_the_board() {
    let bench = Bench::new("slow-start");
    let tools = bench.path("tools");
    std::fs::create_dir(&tools).unwrap();
    let started = tools.join("started");
    let slow = format!(
        "[ -e {0} ] || {{ : > {0}; /bin/sleep 2; }}; exec {1} \"$@\"",
        started.display(),
        qemu()
    );
    script(&tools.join("qemu-system-arm"), &slow);
    let elf = image().to_str().unwrap();
    let run = [
        "run",
        "--host",
        "qemu",
        "--elf",
        elf,
        "--set",
        "run.duration_s=0.1",
    ];
    let mut run = bench.command(&[&run[..], &QUIET].concat());
    let output = run.env("PATH", &tools).output().unwrap();
    assert!(output.status.success(), "{}", errors(&output));
}

#[test]
fn the_log_is_printed_by_defmt_print() {
    let bench = Bench::new("log");
    let image = image().to_str().unwrap();
    let tools = bench.path("tools");
    std::fs::create_dir(&tools).unwrap();
    symlink(qemu(), tools.join("qemu-system-arm")).unwrap();
    let qemu = ["run", "--host", "qemu", "--log", "--elf", image];
    let mut run = bench.command(&[&qemu[..], &SHORT, &QUIET].concat());
    run.env("PATH", &tools);

    let output = run.output().unwrap();
    assert_eq!(output.status.code(), Some(3), "{output:?}");
    assert!(
        errors(&output).contains("cargo install defmt-print"),
        "{output:?}"
    );

    script(
        &tools.join("defmt-print"),
        "PATH=/bin:/usr/bin; echo \"log of $2: $(wc -c) bytes\"",
    );
    let output = run.output().unwrap();
    assert!(output.status.success(), "{output:?}");
    assert!(
        errors(&output).contains(&format!("log of {image}: ")),
        "{output:?}"
    );
}

/// As by Ctrl-Z and fg. The emulator is the first to be stopped and the last to continue, so that its bridge waits for it.
#[test]
#[ignore = "waits for seconds"]
fn the_time_for_which_a_run_is_stopped_is_no_silence_of_the_board() {
    let bench = Bench::new("stopped-together");
    let image = image().to_string_lossy();
    let ticks = ["--set", "run.duration_s=10", "--silence-limit-s", "2"];
    let native = bench.report(&[&["run"], &ticks[..], &QUIET].concat());
    let qemu = ["run", "--host", "qemu", "--elf", &image];
    let mut run = bench.command(&[&qemu[..], &ticks, &QUIET].concat());
    let run = run.process_group(0).stdout(Stdio::piped()).spawn().unwrap();
    let id = run.id().cast_signed();
    let [plant, bridge] = ["plant", "bridge"].map(|child| child_of(id, child));
    let emulator = child_of(bridge, "-machine");
    let pause = || std::thread::sleep(Duration::from_millis(100));
    pause();
    signal(emulator, Signal::SIGSTOP);
    pause();
    signal(-id, Signal::SIGSTOP);
    std::thread::sleep(Duration::from_secs(3));
    for id in [id, plant, bridge] {
        signal(id, Signal::SIGCONT);
    }
    pause();
    signal(emulator, Signal::SIGCONT);
    let output = run.wait_with_output().unwrap();
    assert!(output.status.success(), "{output:?}");
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["log_hash"], native["log_hash"]);
}

#[test]
fn killing_emulator_bridge_or_plant_ends_the_others() {
    for victim in ["emulator", "bridge", "plant"] {
        let bench = Bench::new(&format!("kill-{victim}"));
        let image = image().to_string_lossy();
        let long = [
            "run", "--host", "qemu", "--elf", &image, "--bus", &bench.bus,
        ];
        let duration = ["--set", "run.duration_s=1000"];
        let running = bench.start(&[&long[..], &duration, &QUIET].concat());
        let bridge = child_of(running.id(), "bridge");
        let plant = child_of(running.id(), "plant");
        let emulator = child_of(bridge, "-machine");
        let id = match victim {
            "emulator" => emulator,
            "bridge" => bridge,
            _ => plant,
        };
        signal(id, Signal::SIGKILL);
        // They normally take well under 2 s; the margin is for a busy machine.
        let (output, _) = running.end(Duration::from_secs(6));
        assert!(!output.status.success());
        assert!(!output.stderr.is_empty(), "{victim}: no message");
        let start = Instant::now();
        for id in [emulator, bridge, plant] {
            while is_running(id) {
                assert!(start.elapsed() < Duration::from_secs(6), "{victim}: {id}");
                std::thread::sleep(Duration::from_millis(10));
            }
        }
        // The leftovers of the killed process do not prevent the next run, which removes them.
        let next = ["run", "--bus", &bench.bus];
        let report = bench.report(&[&next[..], &SHORT, &QUIET].concat());
        assert_eq!(report["ticks"], 1000);
        assert!(bench.leftovers().is_empty(), "{:?}", bench.leftovers());
    }
}

//! The host of a board behind a serial port, tested with the flash target's own serial driver in
//! QEMU: the board's answers, the effect of line disturbances, and when it removes the torque on
//! its own.

use std::time::{Duration, Instant};

use painleve_board::{ConnectedBoard, OnBoard, Serial};
use painleve_plant::closed_loop::{ClosedLoop, LoopResult};
use painleve_plant::controller_host::{ControllerHost, InProcess};
use painleve_plant::scenario::Scenario;
use painleve_plant::simulation::Simulation;
use painleve_shared::counts::{ForceCounts, TorqueCounts};
use painleve_shared::frame::{ActuatorFrame, DigitalInputs, SensorFrame};
use painleve_shared::message::{FrameSource, Response};
use painleve_shared::status::{Fault, SupervisorState};
use painleve_tests::Bench;
use painleve_tests::line::{Direction, LineNoise, SerialLine};
use serde_json::Value;

const QUIET: [&str; 3] = ["--json", "--no-record", "--no-plot"];
/// Longest silence of a board on a machine that is busy with other tests: every byte on the line
/// wakes several threads.
const BUSY: Duration = Duration::from_secs(20);
/// A short run, in which frames that are repeated on a busy machine latch no fault.
const SHORT: [&str; 4] = [
    "--set",
    "run.duration_s=0.4",
    "--set",
    "controller.lapses.stale_frames=100",
];

/// Runs a scenario on the board at the end of `line`; returns the run's report and the board's.
fn run(bench: &Bench, line: &SerialLine, more: &[&str]) -> (Value, Value) {
    let port = line.host_port.to_string_lossy();
    let serial = [
        "run",
        "--host",
        "serial",
        "--port",
        &port,
        "--timing",
        "t.json",
        "--silence-limit-s",
        "30",
    ];
    let report = bench.report(&[&serial[..], more, &QUIET].concat());
    let timing = std::fs::read_to_string(bench.path("t.json"));
    let timing = timing.expect("the run writes it");
    (report, serde_json::from_str(&timing).expect("JSON"))
}

fn count(report: &Value, path: &str) -> u64 {
    let value = report.pointer(path).and_then(Value::as_u64);
    value.unwrap_or_else(|| panic!("{path} is no count in {report}"))
}

/// Returns everything in the report that does not depend on repeated frames.
fn course(report: &Value) -> Vec<&Value> {
    [
        "ticks",
        "fault",
        "stale_ticks",
        "lift_offs",
        "final_tip_t_m",
        "min_normal_force_n",
        "peak_torque_nm",
        "saturated_ticks",
    ]
    .map(|key| &report[key])
    .into()
}

/// QEMU answers for the image and the processor, but has no register that names the chip.
#[test]
fn a_board_whose_chip_is_unknown_is_not_accepted() {
    let bench = Bench::new("accept");
    let line = SerialLine::new(LineNoise::None);
    let _board = line.start_board();
    let port = line.host_port.to_string_lossy();
    let output = bench.run(&["accept", "--port", &port, "--json"]);
    assert_eq!(output.status.code(), Some(1));
    let report: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let steps = report["steps"].as_array().expect("steps");
    let checks = steps[0]["checks"].as_array().expect("checks");
    let found: Vec<_> = checks
        .iter()
        .map(|check| (check["what"].as_str(), check["verdict"].as_str()))
        .map(|(what, verdict)| (what.unwrap_or(""), verdict.unwrap_or("")))
        .collect();
    let expected = [
        ("sources of the image", "passed"),
        ("processor", "passed"),
        ("device number", "failed"),
        ("revision, for the errata sheet", "noted"),
    ];
    assert_eq!((steps.len(), &found[..]), (1, &expected[..]), "{report}");
}

#[test]
fn a_run_over_the_line_is_the_native_run() {
    let bench = Bench::new("serial");
    let line = SerialLine::new(LineNoise::None);
    let _board = line.start_board();
    let native = bench.report(&[&["run"], &SHORT[..], &QUIET].concat());
    let (report, timing) = run(&bench, &line, &SHORT);
    assert_eq!(report["host"], "serial");
    assert_eq!(course(&report), course(&native));
    assert_eq!(timing["unit"]["cycles"]["hz"], 1_000_000_000);
    assert_eq!(count(&timing, "/board/lapses/failed_checksums"), 0);
    assert_eq!(count(&timing, "/line/failed_checksums"), 0);
    // On a very busy machine, a repeated frame is answered with a different sequence number.
    if count(&timing, "/line/repeated_requests") == 0 {
        assert_eq!(report["log_hash"], native["log_hash"]);
    }
}

/// Runs the first ticks of the default scenario with the controller on `host`.
fn first_ticks<H: ControllerHost>(ticks: u64, host: H) -> (LoopResult, H) {
    let simulation = Simulation::new(&Scenario::default()).expect("valid");
    let mut closed_loop = ClosedLoop::new(simulation, host);
    for _ in 0..ticks {
        closed_loop.tick(&mut ()).expect("the controller answers");
    }
    closed_loop.finish()
}

#[test]
fn line_noise_is_discarded_and_counted_at_both_ends_without_ending_the_run() {
    let line = SerialLine::new(LineNoise::Steady);
    let _board = line.start_board();
    let configuration = Scenario::default().controller_configuration();
    let serial =
        Serial::open(&line.host_port, &configuration, FrameSource::Lockstep, BUSY).unwrap();
    let (noisy, host) = first_ticks(100, OnBoard::new(serial));
    let (native, _) = first_ticks(100, InProcess::new(&configuration).unwrap());

    // All torques equal those without noise.
    let course = |result: &LoopResult| {
        let statistics = &result.statistics;
        (
            (result.ticks, result.fault, result.stale_ticks),
            (result.final_tip_t_m, result.final_reference_m),
            (statistics.peak_torque_nm, statistics.min_normal_force_n),
        )
    };
    assert_eq!(course(&noisy), course(&native));

    let mut serial = host.board;
    let health = serial.health().unwrap();
    let line_health = serial.line().unwrap();
    for (direction, garbage, checksums) in [
        (
            Direction::ToBoard,
            u64::from(health.lapses.garbage),
            u64::from(health.lapses.failed_checksums),
        ),
        (
            Direction::ToHost,
            line_health.garbage,
            line_health.failed_checksums,
        ),
    ] {
        assert!(garbage > 0 && checksums > 0, "{health:?} {line_health:?}");
        // Disturbances after the last reading of the counters are missing in them.
        let (all, counted) = (line.disturbances(direction), garbage + checksums);
        assert!(
            counted <= all && counted + 3 >= all,
            "{direction:?}: {counted} of {all}"
        );
    }
    assert!(line_health.repeated_requests >= 10, "{line_health:?}");
}

#[test]
fn in_real_time_the_board_sets_the_pace() {
    let bench = Bench::new("board-clock");
    let line = SerialLine::new(LineNoise::None);
    let _board = line.start_board();
    // Slow enough for a busy machine, which may stop the emulator for a second.
    let clock = ["open-loop-bounce", "--pacing", "realtime"];
    let slow = [
        "--set",
        "run.tick_hz=50",
        "--set",
        "run.duration_s=1",
        "--set",
        "controller.estimator.bandwidth_rad_s=100",
        "--set",
        "controller.lapses.missing_frames=100",
    ];
    let (report, _) = run(&bench, &line, &[&clock[..], &slow].concat());
    assert_eq!(report["pacing"], "realtime");
    assert_eq!(report["ticks"], 50);
    assert!(report["wall_s"].as_f64().unwrap() >= 0.94, "{report}");
}

/// The arm at rest, pressing with 10 N, at 50 Hz, a rate that even a busy machine achieves.
struct Pressing {
    board: Serial,
    frame: SensorFrame,
}

impl Pressing {
    fn start(line: &SerialLine) -> Self {
        let overrides = [
            "run.tick_hz=50",
            "controller.estimator.bandwidth_rad_s=100",
            "controller.lapses.missing_frames=100",
        ];
        let scenario = Scenario::load("hybrid-elbow-down", &overrides.map(String::from));
        let scenario = scenario.expect("valid overrides");
        let configuration = scenario.controller_configuration();
        let encoders = configuration.converters.encoders;
        let frame = SensorFrame {
            joints: [
                encoders[0].reading((-11.4_f64).to_radians()),
                encoders[1].reading((-35.1_f64 + 11.4).to_radians()),
            ],
            normal_force: ForceCounts(1024),
            tangential_force: ForceCounts(-614),
            ..Default::default()
        };
        let source = FrameSource::Realtime;
        let board = Serial::open(&line.host_port, &configuration, source, BUSY);
        let board = board.expect("a board on the line");
        Self { board, frame }
    }

    fn tick(&mut self, inputs: DigitalInputs) -> ActuatorFrame {
        self.frame.tick += 1;
        self.frame.sequence += 1;
        self.frame.inputs = inputs;
        let answer = self.board.exchange(&self.frame);
        answer.expect("the board answers").frame
    }
}

const ON: DigitalInputs = DigitalInputs::ENABLE;
const NO_TORQUE: [TorqueCounts; 2] = [TorqueCounts(0); 2];

#[test]
fn silence_latches_a_fault_without_torque_until_rearming() {
    let line = SerialLine::new(LineNoise::None);
    let _board = line.start_board();
    let mut arm = Pressing::start(&line);
    let answers: Vec<_> = (0..15).map(|_| arm.tick(ON)).collect();
    let last = answers[14];
    assert_eq!(last.supervisor_state(), Some(SupervisorState::Tracking));
    assert_ne!(last.torques, NO_TORQUE);

    // The host falls silent. The board reports once, unasked, that it has stopped.
    let start = Instant::now();
    let answered = loop {
        let response = arm.board.listen(Duration::from_secs(1)).unwrap();
        if let Some(Response::Actuator { frame, .. }) = response {
            break frame;
        }
        assert!(start.elapsed() < Duration::from_secs(20), "not a word");
    };
    assert_eq!(answered.latched_fault(), Some(Fault::MissingFrame));
    assert_eq!(answered.torques, NO_TORQUE);
    assert_eq!(
        answered.tick, last.tick,
        "the answer to the last frame is withdrawn"
    );
    assert!(arm.board.health().unwrap().lapses.missing_frames > 100);

    // New frames change nothing, and neither does a reset alone.
    for inputs in [ON, ON, ON | DigitalInputs::RESET, ON] {
        let answer = arm.tick(inputs);
        assert_eq!(answer.torques, NO_TORQUE);
        assert_ne!(answer.supervisor_state(), Some(SupervisorState::Armed));
    }
    arm.tick(DigitalInputs::default());
    let armed = arm.tick(ON);
    assert_eq!(armed.supervisor_state(), Some(SupervisorState::Armed));
    assert_eq!(armed.latched_fault(), None);
    assert_ne!(armed.torques, NO_TORQUE);
}

#[test]
fn a_board_that_is_gone_ends_the_run_with_a_message() {
    let bench = Bench::new("unplugged");
    let line = SerialLine::new(LineNoise::None);
    let board = line.start_board();
    let port = line.host_port.to_string_lossy();
    let serial = ["run", "--host", "serial", "--port", &port];
    let long = ["--set", "run.duration_s=1000"];
    let running = bench.start(&[&serial[..], &long, &QUIET].concat());
    std::thread::sleep(Duration::from_millis(800));
    drop(board);
    // This normally takes well under 2 s; the margin is for a busy machine.
    let (output, _) = running.end(Duration::from_secs(6));
    let text = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(3), "{text}");
    // On a busy machine the plant may miss the bridge before the bridge misses the board.
    assert!(text.contains("has not answered for"), "{text}");
}

/// QEMU's timers count nanoseconds in 32 bits, which last 4.3 s.
#[test]
#[ignore = "waits for seconds"]
fn a_board_idle_for_longer_than_its_timer_counts_is_configured_again() {
    let line = SerialLine::new(LineNoise::None);
    let _board = line.start_board();
    std::thread::sleep(Duration::from_secs(5));
    let configuration = Scenario::default().controller_configuration();
    let serial = Serial::open(
        &line.host_port,
        &configuration,
        FrameSource::Lockstep,
        Duration::from_secs(4),
    );
    let board = serial.expect("it answers");
    let (result, _) = first_ticks(50, OnBoard::new(board));
    assert_eq!((result.ticks, result.fault), (50, None));
}

#[test]
fn a_port_that_cannot_be_used_is_named() {
    let bench = Bench::new("no-port");
    let serial = ["run", "--host", "serial", "--port", "/nowhere/tty"];
    let output = bench.run(&[&serial[..], &QUIET].concat());
    let text = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(3), "{text}");
    assert!(text.contains("/nowhere/tty"), "{text}");
}

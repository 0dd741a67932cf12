//! A native controller in real time latches the same faults as a board: overruns, missing frames
//! and lost frames.

#![allow(clippy::unwrap_used)]

use std::time::{Duration, Instant};

use nix::sys::signal::Signal;
use painleve_link::{BusName, Pacing, PlantEnd, Session};
use painleve_plant::law_choice::build;
use painleve_plant::scenario::Scenario;
use painleve_process::interrupt::Interrupt;
use painleve_shared::counts::{ForceCounts, TorqueCounts};
use painleve_shared::frame::{ActuatorFrame, DigitalInputs, SensorFrame};
use painleve_shared::status::{Fault, SupervisorState};
use painleve_tests::{Bench, child_of, code, errors, is_running, signal};
use serde_json::Value;

const ON: DigitalInputs = DigitalInputs::ENABLE;
const NO_TORQUE: [TorqueCounts; 2] = [TorqueCounts(0); 2];

/// A control rate that even a busy machine achieves.
const SLOW: [&str; 2] = ["run.tick_hz=50", "controller.estimator.bandwidth_rad_s=100"];

/// A run of two seconds in real time, with a report.
fn two_slow_seconds(bench: &Bench) -> Vec<&str> {
    let mut arguments = vec!["run", "--pacing", "realtime", "--bus", &bench.bus];
    arguments.extend(["--json", "--no-record", "--no-plot"]);
    arguments.extend(["--set", "run.duration_s=2"]);
    arguments.extend(SLOW.iter().flat_map(|key| ["--set", key]));
    arguments
}

#[test]
fn a_delayed_controller_ends_the_run_with_a_fault_and_its_exit_code() {
    let bench = Bench::new("held-up");
    let run = bench.start(&two_slow_seconds(&bench));
    let controller = child_of(run.id(), "controller");
    std::thread::sleep(Duration::from_millis(800));
    // About twenty ticks of the plant.
    signal(controller, Signal::SIGSTOP);
    std::thread::sleep(Duration::from_millis(400));
    signal(controller, Signal::SIGCONT);
    let (output, _) = run.end(Duration::from_secs(30));
    assert_eq!(code(output.status), 5, "{output:?}");
    let message = errors(&output);
    assert!(message.contains("missed its deadlines"), "{message}");
    let report: Value = serde_json::from_slice(&output.stdout).expect("a whole report");
    assert_eq!(report["ticks"], 100);
    assert_eq!(report["fault"], Fault::LostFrames as u8);
    assert!(bench.leftovers().is_empty(), "{:?}", bench.leftovers());
}

#[test]
fn a_tick_whose_frame_is_lost_takes_its_time() {
    let bench = Bench::new("lost");
    let mut arguments = two_slow_seconds(&bench);
    arguments.extend(["--set", "converters.link.frame_loss=0.5"]);
    let output = bench.run(&arguments);
    let report: Value = serde_json::from_slice(&output.stdout).expect("a whole report");
    let factor = report["realtime_factor"].as_f64().unwrap();
    assert!((0.9..1.1).contains(&factor), "{report}");
}

/// The arm at rest, pressing with 10 N, as the plant of a native controller.
struct Pressing {
    end: PlantEnd,
    frame: SensorFrame,
}

impl Pressing {
    fn new(bus: &str) -> Self {
        Self::of_build(build(), bus)
    }

    fn of_build(build: u64, bus: &str) -> Self {
        let scenario = Scenario::load("hybrid-elbow-down", &SLOW.map(String::from));
        let scenario = scenario.expect("valid overrides");
        let configuration = scenario.controller_configuration();
        let [encoder, _] = configuration.converters.encoders;
        let session = Session {
            configuration: postcard::to_stdvec(&(build, configuration)).unwrap(),
            ..Session::new(&scenario, Pacing::Realtime).unwrap()
        };
        let bus: BusName = bus.parse().unwrap();
        Self {
            end: PlantEnd::create(&bus, None, &session, &Interrupt::default()).unwrap(),
            frame: SensorFrame {
                joints: [
                    encoder.reading((-11.4_f64).to_radians()),
                    encoder.reading((-35.1_f64 + 11.4).to_radians()),
                ],
                normal_force: ForceCounts(1024),
                tangential_force: ForceCounts(-614),
                ..Default::default()
            },
        }
    }

    /// Sends the next frame and returns its answer. Frames are sent at once, because the controller
    /// begins a tick whenever a frame arrives.
    fn tick(&mut self, inputs: DigitalInputs) -> ActuatorFrame {
        self.frame.tick += 1;
        self.frame.sequence += 1;
        self.frame.inputs = inputs;
        self.end.send(&self.frame).unwrap();
        self.answer(self.frame.tick)
    }

    /// Waits for the answer to this tick.
    fn answer(&mut self, tick: u32) -> ActuatorFrame {
        let start = Instant::now();
        loop {
            match self.end.try_receive().unwrap() {
                Some(answer) if answer.tick == tick => return answer,
                _ => assert!(start.elapsed() < Duration::from_secs(20), "no answer"),
            }
            std::thread::sleep(Duration::from_micros(100));
        }
    }
}

/// The bytes of a configuration carry no names: those of another build may mean something else.
#[test]
fn a_controller_refuses_the_plant_of_another_build() {
    let bench = Bench::new("other-build");
    let mut plant = Pressing::of_build(build() ^ 1, &bench.bus);
    let controller = bench.start(&["controller", "--bus", &bench.bus, "--wait-s", "20"]);
    // Announces the session; the controller leaves before its first frame.
    while is_running(controller.id()) {
        let _ = plant.end.wait_for_controller(Duration::from_millis(100));
    }
    let (output, _) = controller.end(Duration::from_secs(30));
    drop(plant);
    assert_eq!(code(output.status), 3, "{output:?}");
    let message = errors(&output);
    assert_eq!(message.trim().lines().count(), 1, "{message}");
    for part in ["error: ", &bench.bus, "use the same program for both ends"] {
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn overruns_and_missing_frames_latch_a_fault_as_on_a_board() {
    let bench = Bench::new("too-long");
    let mut arm = Pressing::new(&bench.bus);
    let controller = bench.start(&["controller", "--bus", &bench.bus, "--wait-s", "20"]);
    arm.end
        .wait_for_controller(Duration::from_secs(20))
        .unwrap();
    let answers: Vec<_> = (0..15).map(|_| arm.tick(ON)).collect();
    assert_eq!(
        answers[14].supervisor_state(),
        Some(SupervisorState::Tracking)
    );
    assert_ne!(answers[14].torques, NO_TORQUE);

    // One tick that overruns is tolerated, and two in time make up for it; two in a row are too many.
    let overload = ON | DigitalInputs::OVERLOAD;
    for inputs in [overload, ON, ON, overload] {
        assert_eq!(arm.tick(inputs).latched_fault(), None);
    }
    // The answer already sent is withdrawn.
    arm.tick(overload);
    let withdrawn = arm.answer(arm.frame.tick);
    assert_eq!(withdrawn.latched_fault(), Some(Fault::Overrun));
    assert_eq!(withdrawn.torques, NO_TORQUE);

    // Arm again, then fall silent.
    let start_again = [ON | DigitalInputs::RESET, DigitalInputs::default(), ON];
    let armed = start_again.map(|inputs| arm.tick(inputs))[2];
    assert_eq!(armed.supervisor_state(), Some(SupervisorState::Armed));
    let answered = arm.answer(armed.tick);
    assert_eq!(answered.latched_fault(), Some(Fault::MissingFrame));
    assert_eq!(answered.torques, NO_TORQUE);

    arm.end.end().unwrap();
    let (output, _) = controller.end(Duration::from_secs(20));
    assert!(output.status.success(), "{output:?}");
}

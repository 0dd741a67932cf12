//! `painleve commission` end to end: the test is the operator, who reads the tasks and moves the simulated
//! arm.

use std::io::{BufRead, BufReader};
use std::process::Output;

use painleve_flash_image::bench::{BoardBench, scenario};
use painleve_plant::mechanics::belt::BeltProfile;
use painleve_plant::scenario::{InitialState, Scenario};
use painleve_shared::counts::ForceCounts;
use painleve_shared::{Arm, Posture};
use painleve_tests::Bench;

use crate::drive::rig::{DEFAULT, EmulatedRig, StartedProgram};

/// The arm with its tip on the standing belt, 10 mm from the point below joint 1.
fn set_down() -> Scenario {
    let mut scenario = scenario(DEFAULT);
    scenario.belt.profile = BeltProfile::Constant { speed_m_s: 0.0 };
    let arm = Arm::new(scenario.arm).unwrap();
    let theta = arm.link_angles_on_belt_rad(0.01, Posture::ElbowDown);
    let [theta_1, theta_2] = theta.unwrap().to_array().map(f64::to_degrees);
    scenario.initial = InitialState::at_rest(theta_1, theta_2);
    scenario
}

/// Mounts an arm with several mistakes that settings describe.
fn mount_wrongly(bench: &mut BoardBench) {
    bench.mounted.encoder_reversed = [true, false];
    bench.mounted.stage_reversed = [false, true];
    bench.mounted.force_reversed = [true, true];
    bench.mounted.force_tare = [ForceCounts(120), ForceCounts(-250)];
    // 30° of 14 bits.
    bench.encoder_offset = [0, 1365];
}

/// Follows the program's tasks until it ends. Returns what it has printed on standard error, too.
fn commission(rig: &EmulatedRig, folder: Bench, scenario: &str) -> (Output, String, Bench) {
    let arguments = ["commission", scenario, "--output", "commissioned.toml"];
    let mut program = StartedProgram::start(folder, &rig.port, &arguments);
    let stderr = program.child.stderr.take().unwrap();
    let mut text = String::new();
    for line in BufReader::new(stderr).lines() {
        let line = line.unwrap();
        text += &(line.clone() + "\n");
        let held = |task: &str| line.contains(task);
        if held("hold link 1 straight down, and link 2 level") {
            rig.act(|bench| bench.hold([0.0, 90.0]));
        } else if held("and link 2 level") {
            rig.act(|bench| bench.hold([90.0, 90.0]));
        } else if held("and link 2 straight down") {
            rig.act(|bench| bench.hold([90.0, 0.0]));
        } else if held("set the tip on it") {
            rig.act(|bench| bench.set_down(&set_down()));
        } else if held("switch ENABLE") {
            assert_eq!(rig.ticks_on(), 0, "the stages were on before");
            rig.close_switch();
            continue;
        } else {
            continue;
        }
        // The board reads the arm a tick later.
        let ticks = rig.ticks();
        rig.wait_until("the arm is held", |rig| rig.ticks() > ticks + 20);
        program.order("");
    }
    let (output, folder) = program.end();
    rig.wait_until("the torque is off", |rig| !rig.is_on());
    (output, text, folder)
}

#[test]
#[ignore = "two commissionings at the rate of the wall clock"]
fn an_arm_is_commissioned_and_its_corrected_scenario_describes_it() {
    let rig = EmulatedRig::new();
    rig.act(mount_wrongly);
    let (output, text, folder) = commission(&rig, Bench::new("commission"), DEFAULT);
    assert!(output.status.success(), "{text}");
    assert!(rig.ticks_on() > 500);
    let report = String::from_utf8(output.stdout).unwrap();
    let corrected = [
        "encoder of joint 1: counts in the other direction",
        "encoder of the elbow: its zero is 30.0° off",
        "force cell: without a load, f_n reads -2.44 N",
        "force cell: f_n has the other sign",
        "torque stage of the elbow: turns its joint in the other direction",
        "force cell: f_t has the other sign",
        "friction of the tip on the belt: 0.6",
    ];
    for part in corrected {
        assert!(report.contains(part), "{part}: {report}");
    }
    drop(rig);
    // The same arm with its corrected scenario: nothing is left to correct.
    let rig = EmulatedRig::new();
    rig.act(mount_wrongly);
    let corrected = folder.path("commissioned.toml");
    let (output, text, _) = commission(&rig, Bench::new("again"), corrected.to_str().unwrap());
    assert!(output.status.success(), "{text}");
    let report = String::from_utf8(output.stdout).unwrap();
    assert!(
        report.contains("the scenario describes how the arm is mounted"),
        "{report}"
    );
}

#[test]
fn a_gear_of_another_ratio_is_named_and_nothing_is_written() {
    let rig = EmulatedRig::new();
    // The scenario says that there is no gear.
    rig.act(|bench| bench.gear = [1.0, 3.0]);
    let (output, text, folder) = commission(&rig, Bench::new("commission"), DEFAULT);
    assert_eq!(output.status.code(), Some(1), "{text}");
    for part in [
        "torque stage of the elbow: gives ",
        "as if converters.stages.gear_ratio were ",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
    assert!(!folder.path("commissioned.toml").exists());
}

#[test]
fn a_dead_force_line_is_named_and_nothing_is_written() {
    let rig = EmulatedRig::new();
    rig.act(|bench| bench.board.wiring().force.dead = Some(false));
    let (output, text, folder) = commission(&rig, Bench::new("commission"), DEFAULT);
    assert_eq!(output.status.code(), Some(1), "{text}");
    assert!(
        text.contains("force cell: no readings between the codes"),
        "{text}"
    );
    assert_eq!(rig.ticks_on(), 0);
    assert!(!folder.path("commissioned.toml").exists());
}

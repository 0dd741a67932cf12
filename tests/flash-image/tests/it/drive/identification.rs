//! `painleve identify` end to end: the test is the operator, who carries the simulated arm to its belt.

use std::io::{BufRead, BufReader};

use painleve_commission::elbow_side;
use painleve_commission::identification::{FORCE_N, slide_scenario};
use painleve_flash_image::bench::scenario;
use painleve_plant::scenario::Scenario;
use painleve_shared::Posture;
use painleve_tests::Bench;
use serde_json::Value;

use crate::drive::rig::{DEFAULT, EmulatedRig, StartedProgram};

const FRICTION_NM: f64 = 0.05;

/// Zero of the elbow's encoder, counts.
const ZERO_COUNTS: u16 = 40;

/// The arm with its tip on the running belt below joint 1, as the program asks for it.
fn at_start(task: &str) -> Scenario {
    let mut postures = [Posture::ElbowDown, Posture::ElbowUp].into_iter();
    let posture = postures.find(|it| task.contains(elbow_side(*it))).unwrap();
    let elbow = match posture {
        Posture::ElbowDown => "down",
        Posture::ElbowUp => "up",
    };
    let overrides = [
        "contact.kind=compliant".to_owned(),
        format!("effects.joints.coulomb_nm={FRICTION_NM}"),
        format!("initial={{ tip_m = 0.0, elbow = '{elbow}' }}"),
    ];
    let arm = scenario(DEFAULT).with_overrides("arm", &overrides).unwrap();
    let slide = slide_scenario(&arm, 0.5, posture, FORCE_N).unwrap();
    let belt_m_s = slide.belt.profile.speed_m_s(0.0);
    let direction = if belt_m_s < 0.0 { "−t" } else { "+t" };
    assert!(task.contains(&format!(
        "towards {direction}, at about {:.2} m/s",
        belt_m_s.abs()
    )));
    slide
}

#[test]
#[ignore = "takes minutes"]
fn an_arm_on_a_board_is_identified() {
    let rig = EmulatedRig::new();
    rig.act(|bench| bench.encoder_offset = [0, ZERO_COUNTS]);
    // As after commissioning.
    let commissioned = "knowledge.source='drawn, zeros by plumb line'";
    let output = ["--json", "--output", "identified.toml"];
    let arguments = [&["identify", DEFAULT, "--set", commissioned][..], &output].concat();
    let mut program = StartedProgram::start(Bench::new("identify"), &rig.port, &arguments);
    let stderr = program.child.stderr.take().unwrap();
    let mut text = String::new();
    for line in BufReader::new(stderr).lines() {
        let line = line.unwrap();
        text += &(line.clone() + "\n");
        if line.contains("hold the arm with its tip on the belt") {
            rig.carry(at_start(&line));
            program.order("");
        } else if line.contains("open the switch ENABLE") {
            rig.open_switch();
            let ticks = rig.ticks();
            rig.wait_until("the board sees the switch", |rig| rig.ticks() > ticks + 20);
            rig.close_switch();
        }
    }
    let (output, folder) = program.end();
    assert!(output.status.success(), "{text}");
    rig.wait_until("the torque is off", |rig| !rig.is_on());
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    for joint in 0..2 {
        let friction = &found["joints"][joint]["coulomb_friction_nm"]["value"];
        let error_nm = friction.as_f64().unwrap() - FRICTION_NM;
        assert!(error_nm.abs() < 0.06 * FRICTION_NM, "{joint}: {found}");
    }
    let identified = std::fs::read_to_string(folder.path("identified.toml")).unwrap();
    let identified: toml::Value = toml::from_str(&identified).unwrap();
    let estimator = &identified["controller"]["estimator"];
    let [_, zero] = &estimator["encoders"]["zero_rad"].as_array().unwrap()[..] else {
        panic!("{estimator}");
    };
    // A zero is strongly correlated with the encoder's error once around.
    let truth_rad = -f64::from(ZERO_COUNTS) * core::f64::consts::TAU / 16384.0;
    let error_rad = zero.as_float().unwrap() - truth_rad;
    assert!(error_rad.abs() < 0.01, "{zero} {truth_rad}");
}

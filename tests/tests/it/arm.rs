//! `painleve arm`: arms of URDF and MJCF files, and MuJoCo as the witness of their equations of motion.

#![allow(clippy::unwrap_used)]

use std::process::Command;

use painleve_plant::scenario::Scenario;
use painleve_shared::kinematics::Pose;
use painleve_shared::{Arm, LinkMotion};
use painleve_tests::python::{python, workspace};
use painleve_tests::{Bench, code, errors};
use serde_json::Value;

/// Bodies of all shapes, turned in all ways of MJCF. Its links hang along −z at zero, and its elbow turns the other way.
const SHAPES: &str = r#"<mujoco>
  <compiler angle="radian" eulerseq="ZYX"/>
  <option gravity="0 1 -9.5"/>
  <default>
    <geom density="600"/>
    <joint axis="0 1 0" armature="2e-4"/>
    <default class="light"><geom density="150" type="cylinder"/></default>
  </default>
  <worldbody>
    <geom type="plane" size="1 1 1"/>
    <body name="upper" pos="0 0 1.5">
      <joint name="shoulder"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02"/>
      <geom type="box" pos="0 0.03 -0.1" euler="0.2 0.1 0.4" size="0.01 0.02 0.03" density="300"/>
      <frame pos="0 0 -0.15" zaxis="0 1 0" childclass="light">
        <geom pos="0 0 0.02" size="0.03 0.01"/>
      </frame>
      <body name="lower" pos="0 0.05 -0.3" childclass="light">
        <joint name="elbow" axis="0 -3 0" pos="0 0.01 0"/>
        <geom fromto="0 0 0 0 0 -0.26" size="0.015"/>
        <geom type="ellipsoid" size="0.01 0.02 0.03" pos="0 0 -0.2" axisangle="1 1 0 0.3" mass="0.05"/>
        <body name="hand" pos="0 0 -0.26" xyaxes="0 1 0 0 0 1"><geom type="sphere" size="0.02"/></body>
      </body>
    </body>
  </worldbody>
</mujoco>"#;

/// Prints the mass matrix and the torque of gravity at three places of the joints.
const MUJOCO: &str = r#"
import json, sys, mujoco, numpy
model = mujoco.MjModel.from_xml_path(sys.argv[1])
data, places = mujoco.MjData(model), []
for place in [[0.3, -0.7], [-1.2, 2.0], [2.5, 0.4]]:
    data.qpos[:] = place
    mujoco.mj_forward(model, data)
    mass = numpy.zeros((2, 2))
    for row, unit in zip(mass, numpy.eye(2)):
        mujoco.mj_mulM(model, data, row, unit)
    places.append({"place": place, "mass": mass.tolist(), "gravity": data.qfrc_bias.tolist()})
print(json.dumps(places))
"#;

/// Compares the arm of a file with MuJoCo's; `sense` is the direction of the elbow.
fn compare(python: &std::path::Path, name: &str, text: &str, sense: f64) {
    let bench = Bench::new(name);
    std::fs::write(bench.path(name), text).unwrap();
    let printed = bench.run(&["arm", name]);
    assert_eq!(code(printed.status), 0, "{}", errors(&printed));
    std::fs::write(bench.path("arm.toml"), &printed.stdout).unwrap();
    let path = bench.path("arm.toml");
    let scenario = Scenario::load(&path.to_string_lossy(), &[]).unwrap();
    let arm = Arm::new(scenario.arm).unwrap();
    let output = Command::new(python)
        .args(["-c", MUJOCO])
        .arg(bench.path(name))
        .output()
        .unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{stderr}");
    let places: Vec<Value> = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(places.len(), 3);
    for at in places {
        let number = |value: &Value| value.as_f64().unwrap();
        let [q1, q2] = [0, 1].map(|k| number(&at["place"][k]));
        let theta = LinkMotion::new(q1, q1 + sense * q2);
        let pose = Pose::new(&theta);
        let mass = arm.mass_matrix(&pose);
        let [m11, m12, m22] = [mass.m11, mass.m12, mass.m22];
        let torque = arm.passive_torque_nm(&theta, &LinkMotion::zeros(), &pose);
        let expected = [
            (m11 + 2.0 * m12 + m22, &at["mass"][0][0]),
            (sense * (m12 + m22), &at["mass"][0][1]),
            (m22, &at["mass"][1][1]),
            (torque.first() + torque.second(), &at["gravity"][0]),
            (sense * torque.second(), &at["gravity"][1]),
        ];
        for (ours, theirs) in expected {
            let theirs = number(theirs);
            let tolerance = 1e-6 * theirs.abs().max(1e-3);
            assert!(
                (ours - theirs).abs() < tolerance,
                "{name} {q1}: {ours} {theirs}"
            );
        }
    }
}

#[test]
#[ignore = "needs Python packages of the network"]
fn an_arm_moves_as_mujoco_moves_it() {
    let Some(python) = python("mujoco", &["mujoco", "numpy"]) else {
        return;
    };
    let urdf = std::fs::read_to_string(workspace().join("examples/two-link.urdf")).unwrap();
    compare(&python, "two-link.urdf", &urdf, 1.0);
    compare(&python, "shapes.xml", SHAPES, -1.0);
}

#[test]
fn the_scenario_of_an_arm_runs() {
    let bench = Bench::new("arm-runs");
    let example = workspace().join("examples/two-link.urdf");
    let printed = bench.run(&["arm", &example.to_string_lossy()]);
    assert_eq!(code(printed.status), 0);
    assert_eq!(
        errors(&printed),
        "the file has no belt: height_m = 0.396 is 0.9 of the arm's reach\nignored: 1 × <limit>, 1 × <visual>\n"
    );
    std::fs::write(bench.path("arm.toml"), &printed.stdout).unwrap();
    let report = bench.report(&["run", "arm.toml", "--no-plot", "--json"]);
    assert_eq!(report["kept"], true, "{report}");
}

#[test]
fn a_file_without_arm_is_refused_with_its_name() {
    let bench = Bench::new("arm-refused");
    std::fs::write(bench.path("note.urdf"), "<note/>").unwrap();
    let cases = [
        (
            "note.urdf",
            "note.urdf: <note> is neither the <robot> of a URDF nor the <mujoco> of an MJCF file",
        ),
        (
            "none.urdf",
            "none.urdf: No such file or directory (os error 2)",
        ),
    ];
    for (file, message) in cases {
        let output = bench.run(&["arm", file]);
        assert_eq!(code(output.status), 2);
        assert_eq!(errors(&output), format!("error: {message}\n"));
    }
}

//! The Python examples: a controller on the bus and MuJoCo as the plant, in a virtual environment.

use std::process::{Command, Stdio};

use painleve_tests::Bench;
use painleve_tests::python::{python, workspace};
use serde_json::Value;

#[test]
#[ignore = "needs Python packages of the network"]
fn a_controller_in_python_answers_on_the_bus_and_the_report_names_it() {
    let Some(python) = python("bus", &["iceoryx2==0.9.*"]) else {
        return;
    };
    let bench = Bench::new("python-controller");
    let mut plant = bench.command(&["plant", "--bus", &bench.bus]);
    let plant = plant
        .args(["--wait-s", "20", "--set", "run.duration_s=1", "--json"])
        .args(["--no-record", "--no-plot"])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let controller = Command::new(python)
        .arg(workspace().join("examples/python/controller.py"))
        .arg(&bench.bus)
        .output()
        .unwrap();
    let stderr = String::from_utf8_lossy(&controller.stderr);
    assert!(controller.status.success(), "{stderr}");
    let plant = plant.wait_with_output().unwrap();
    let report: Value = serde_json::from_slice(&plant.stdout).unwrap();
    assert_eq!(report["controller"], "python spring");
    assert_eq!(report["host"], "external");
    assert_eq!(
        (&report["lift_offs"], &report["stale_ticks"]),
        (&0.into(), &0.into())
    );
}

#[test]
#[ignore = "needs Python packages of the network"]
fn mujoco_is_the_plant_behind_the_controller() {
    let Some(python) = python("mujoco", &["mujoco", "numpy"]) else {
        return;
    };
    let built = Command::new(env!("CARGO"))
        .args(["build", "--package", "painleve-c-abi"])
        .current_dir(workspace())
        .status()
        .unwrap();
    assert!(built.success());
    let run = Command::new(python)
        .arg(workspace().join("examples/python/mujoco_plant.py"))
        .arg(workspace().join("target/debug/libpainleve_c.so"))
        .output()
        .unwrap();
    let [stdout, stderr] = [&run.stdout, &run.stderr].map(|text| String::from_utf8_lossy(text));
    assert!(run.status.success(), "{stdout}{stderr}");
}

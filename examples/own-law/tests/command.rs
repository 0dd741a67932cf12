//! The whole command works with a user-defined law: runs, studies, error messages, and the image in
//! QEMU, whose torque counts equal those of the native controller exactly.

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

const LAW: &str = "controller.law={impedance={}}";

fn own_law(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_own-law"))
        .args(arguments)
        .output()
        .unwrap()
}

fn run(more: &[&str]) -> Value {
    let arguments = ["run", "--set", LAW, "--no-plot", "--no-record", "--json"];
    let output = own_law(&[&arguments, more].concat());
    assert!(output.status.success(), "{output:?}");
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn the_law_slides_to_the_papers_limit() {
    let report = run(&[]);
    assert_eq!(report["controller"], "impedance");
    assert_eq!(report["lift_offs"], 0);
    let tip_m = report["final_tip_t_m"].as_f64().unwrap();
    assert!((tip_m - 0.148).abs() < 1e-3, "{tip_m}");
}

#[test]
#[ignore = "needs the image: cargo build --profile firmware -p own-law --bin own-law-f405 --target thumbv7em-none-eabihf"]
fn the_emulated_board_gives_the_same_bits() {
    let image = Path::new(env!("CARGO_BIN_EXE_own-law"))
        .with_file_name("../thumbv7em-none-eabihf/firmware/own-law-f405");
    let image = image.to_str().unwrap();
    let short = ["--set", "run.duration_s=1"];
    let native = run(&short);
    // On a busy machine the emulator may stand still for seconds.
    let emulated = ["--host", "qemu", "--elf", image, "--silence-limit-s", "30"];
    let emulated = run(&[&short[..], &emulated].concat());
    assert_eq!(native["log_hash"], emulated["log_hash"]);
}

#[test]
fn a_study_runs_with_the_law() {
    let study = [
        "study",
        "sliding-range",
        "--controller",
        "hybrid-elbow-up",
        "--posture",
        "elbow-up",
    ];
    let output = own_law(
        &[
            &study[..],
            &["--converters", "hardware", "--set", LAW, "--json"],
        ]
        .concat(),
    );
    assert!(output.status.success(), "{output:?}");
    assert!(String::from_utf8_lossy(&output.stdout).contains("hybrid-elbow-up"));
}

fn text(arguments: &[&str]) -> String {
    let output = own_law(arguments);
    assert!(output.status.success(), "{output:?}");
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn schema_and_printed_scenarios_describe_the_laws_settings() {
    let schema: Value = serde_json::from_str(&text(&["scenarios", "--schema"])).unwrap();
    let laws = &schema["properties"]["controller"]["properties"]["law"]["oneOf"];
    let impedance = laws.as_array().unwrap().iter();
    let mut impedance = impedance.map(|law| &law["properties"]["impedance"]["properties"]);
    let stiffness = impedance.find_map(|settings| settings.get("stiffness_n_m"));
    assert_eq!(stiffness.unwrap()["maximum"], 1e5);
    let printed = text(&["scenarios", "hybrid-elbow-down", "--set", LAW]);
    for part in [
        "[controller.law.impedance]",
        "# Stiffness along the belt. (0 to 100000 N/m)\nstiffness_n_m = 1500",
        "(off, pid, hybrid or impedance)",
    ] {
        assert!(printed.contains(part), "{part}\nis not in\n{printed}");
    }
}

#[test]
fn a_setting_out_of_range_is_refused_by_its_key() {
    let set = "controller.law={impedance={stiffness_n_m=-1}}";
    let output = own_law(&["run", "--set", set]);
    assert_eq!(output.status.code(), Some(2));
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        message.contains("controller.law.impedance.stiffness_n_m"),
        "{message}"
    );
}

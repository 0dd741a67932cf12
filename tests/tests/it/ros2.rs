//! `painleve export --ros2`: a bag that the ROS 2 reader of PyPI's `mcap-ros2-support` reads.

#![allow(clippy::unwrap_used)]

use std::process::Command;

use painleve_tests::python::python;
use painleve_tests::{Bench, code, errors};
use serde_json::Value;

const READ: &str = r#"
import json, sys
from mcap_ros2.reader import read_ros2_messages
counts, last = {}, {}
for message in read_ros2_messages(sys.argv[1]):
    topic = message.channel.topic
    counts[topic] = counts.get(topic, 0) + 1
    last[topic] = message.ros_msg
joints, contact, plant = last["/joint_states"], last["/contact"], last["/plant"]
print(json.dumps({
    "counts": counts, "names": list(joints.name), "position": list(joints.position), "effort": list(joints.effort),
    "normal_n": contact.wrench.force.z, "frame": contact.header.frame_id, "seconds": joints.header.stamp.sec,
    "theta2_rad": plant.theta2_rad, "theta1_rad": plant.theta1_rad, "mode": plant.mode, "friction": last["/estimates"].friction,
}))
"#;

#[test]
#[ignore = "needs Python packages of the network"]
fn a_bag_is_read_by_the_reader_of_ros2() {
    let Some(python) = python("ros2", &["mcap-ros2-support"]) else {
        return;
    };
    let bench = Bench::new("ros2");
    bench.report(&[
        "run",
        "edge",
        "--set",
        "run.duration_s=0.3",
        "--no-plot",
        "--json",
    ]);
    let report = bench.report(&["export", "out/run.mcap", "--ros2", "--json"]);
    assert_eq!(report["files"][0], "out/run.ros2.mcap");
    let output = Command::new(python)
        .args(["-c", READ])
        .arg(bench.path("out/run.ros2.mcap"))
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let read: Value = serde_json::from_slice(&output.stdout).unwrap();
    for topic in [
        "/plant",
        "/sensor",
        "/actuator",
        "/estimates",
        "/joint_states",
        "/contact",
    ] {
        assert_eq!(read["counts"][topic], 300, "{topic}: {read}");
    }
    let number = |value: &Value| value.as_f64().unwrap();
    let elbow = number(&read["theta2_rad"]) - number(&read["theta1_rad"]);
    assert!(
        (number(&read["position"][1]) - elbow).abs() < 1e-12,
        "{read}"
    );
    assert!((number(&read["normal_n"]) - 10.0).abs() < 1.0, "{read}");
    assert!((number(&read["friction"]) - 0.6).abs() < 0.05, "{read}");
    assert_eq!(
        (&read["frame"], &read["mode"]),
        (&"belt".into(), &"slide-positive".into())
    );
    // By the clock, not from 1970.
    assert!(read["seconds"].as_i64().unwrap() > 1_700_000_000, "{read}");
}

#[test]
fn what_is_no_record_makes_no_bag() {
    let bench = Bench::new("ros2-refused");
    std::fs::write(bench.path("other.mcap"), "no bag").unwrap();
    let output = bench.run(&["export", "other.mcap", "--ros2"]);
    assert_eq!(code(output.status), 2);
    assert!(
        errors(&output).contains("other.mcap"),
        "{}",
        errors(&output)
    );
    let neither = errors(&bench.run(&["export", "other.mcap"]));
    for option in ["--csv", "--ros2"] {
        assert!(neither.contains(option), "{neither}");
    }
    assert_eq!(bench.files(), ["other.mcap"]);
}

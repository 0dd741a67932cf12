//! `painleve drive` and `painleve commission` end to end: the program is at one end of a pseudo-terminal, the flashed image
//! at the other, with the simulated arm on its sensors and stages.

#![allow(clippy::unwrap_used)]

mod commissioning;
mod identification;
pub mod rig;
mod stored;

use std::io::{Read, Write};
use std::process::Output;

use nix::sys::signal::Signal;
use painleve_shared::message::{PROTOCOL, Request, Response};
use painleve_shared::wire::{self, Inbox};
use painleve_tests::line::terminal;
use painleve_tests::{errors, signal};

use crate::drive::rig::{EmulatedRig, StartedProgram};

fn report(output: &Output) -> serde_json::Value {
    assert!(output.status.success(), "{}", errors(output));
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn an_arm_is_driven_after_the_order_and_the_switch_and_recorded() {
    let rig = EmulatedRig::new();
    let mut program = StartedProgram::drive(&rig.port, &["--record", "drive.mcap"]);
    // The switch alone does not arm the drive.
    rig.wait_for_work();
    rig.close_switch();
    let ticks = rig.ticks();
    rig.wait_until("the switch has been closed for a while", |rig| {
        rig.ticks() > ticks + 100
    });
    assert!(!rig.is_on());
    // Nor does the order, with a switch that has been closed before it.
    program.order("arm");
    program.wait_for("arming is permitted");
    let ticks = rig.ticks();
    rig.wait_until("arming has been permitted for a while", |rig| {
        rig.ticks() > ticks + 100
    });
    assert!(!rig.is_on());
    rig.open_switch();
    rig.close_switch();
    rig.wait_until("the arm is driven", EmulatedRig::is_on);
    let ticks = rig.ticks();
    rig.wait_until("it has been driven for a while", |rig| {
        rig.ticks() > ticks + 300
    });
    assert!(rig.is_on());
    program.order("disarm");
    rig.wait_until("the torque is off", |rig| !rig.is_on());
    program.order("stop");
    let (output, folder) = program.end();
    let report = report(&output);
    assert!(report["active_ticks"].as_u64() > Some(300), "{report}");
    assert_eq!(report["lost_ticks"], 0, "{report}");
    assert_eq!(report["fault"], 0, "{report}");
    let text = errors(&output);
    for part in [
        "Set the tip down here",
        "arming is permitted",
        "state: armed",
        "state: tracking",
    ] {
        assert!(text.contains(part), "{text}");
    }
    let record = std::fs::read(folder.path("drive.mcap")).unwrap();
    let messages = mcap::MessageStream::new(&record).unwrap();
    let topics: Vec<String> = messages
        .map(|it| it.unwrap().channel.topic.clone())
        .collect();
    for topic in ["/plant", "/sensor", "/actuator"] {
        let count = topics.iter().filter(|it| *it == topic).count() as u64;
        assert_eq!(Some(count), report["ticks"].as_u64(), "{topic}");
    }
}

/// The output of half a second of a dry run with the switch closed.
fn dry_run(rig: &EmulatedRig, settings: &[&str]) -> Output {
    let dry = ["--dry-run", "--no-record", "--duration", "0.5"];
    let mut program = StartedProgram::drive(&rig.port, &[&dry[..], settings].concat());
    program.order("arm");
    program.wait_for("arming is permitted");
    rig.close_switch();
    program.end().0
}

#[test]
fn a_dry_run_keeps_the_stages_off() {
    let rig = EmulatedRig::new();
    let output = dry_run(&rig, &[]);
    assert!(!errors(&output).contains("one sensor on each channel"));
    assert!(report(&output)["active_ticks"].as_u64() > Some(50));
    assert_eq!(rig.ticks_on(), 0);
}

#[test]
fn an_arm_with_one_sensor_on_each_channel_is_an_exception_that_is_announced() {
    let one = "converters.mounting.sensors=first";
    let output = dry_run(&EmulatedRig::new(), &["--set", one]);
    let warning = "one sensor on each channel: the board detects a frozen encoder";
    assert!(errors(&output).contains(warning));
    assert!(report(&output)["active_ticks"].as_u64() > Some(50));
}

#[test]
fn a_rate_at_which_the_sensors_cannot_be_read_is_refused() {
    let rig = EmulatedRig::new();
    for (sensors, rate, fastest) in [("both", 3000, 2500), ("first", 8000, 7500)] {
        let sensors = format!("converters.mounting.sensors={sensors}");
        let set = format!("run.tick_hz={rate}");
        let arguments = ["--set", &set, "--set", &sensors, "--no-record"];
        let (output, _) = StartedProgram::drive(&rig.port, &arguments).end();
        assert_eq!(output.status.code(), Some(2));
        let text = errors(&output);
        let range = format!("run.tick_hz = {rate} is outside the allowed range 10 to {fastest}");
        assert!(text.contains(&range), "{text}");
    }
}

#[test]
fn ctrl_c_and_a_killed_program_take_the_torque_off() {
    for (by, limit_ticks) in [(Signal::SIGINT, 60), (Signal::SIGKILL, 260)] {
        let rig = EmulatedRig::new();
        let mut program = StartedProgram::drive(&rig.port, &["--no-record"]);
        program.order("arm");
        program.wait_for("arming is permitted");
        rig.close_switch();
        rig.wait_until("the arm is driven", EmulatedRig::is_on);
        let ticks = rig.ticks();
        signal(program.child.id().cast_signed(), by);
        rig.wait_until("the torque is off", |rig| !rig.is_on());
        assert!(rig.ticks() - ticks < limit_ticks, "{by}");
        let (output, _) = program.end();
        assert_eq!(output.status.success(), by == Signal::SIGINT);
    }
}

/// A board of another build answers; nothing is configured.
#[test]
fn another_build_or_protocol_is_refused_and_both_are_named() {
    let build = painleve_plant::law_choice::build();
    for (protocol, build, named) in [
        (
            PROTOCOL + 1,
            build,
            vec![
                format!("protocol {}", PROTOCOL + 1),
                format!("protocol {PROTOCOL}"),
            ],
        ),
        (
            PROTOCOL,
            build ^ 1,
            vec![format!("{build:016x}"), format!("{:016x}", build ^ 1)],
        ),
    ] {
        let (mut line, _far, port) = terminal();
        let program = StartedProgram::drive(&port, &["--no-record"]);
        let mut inbox = Inbox::new();
        let mut bytes = [0; 1024];
        'asked: loop {
            let length = line.read(&mut bytes).unwrap();
            for byte in &bytes[..length] {
                if let Some(message) = inbox.push(*byte)
                    && matches!(wire::decode(message), Ok(Request::Identify))
                {
                    break 'asked;
                }
            }
        }
        let mut buffer = [0; 96];
        let identity = Response::Identity { protocol, build };
        line.write_all(wire::encode(&identity, &mut buffer).unwrap())
            .unwrap();
        let (output, _) = program.end();
        assert_eq!(output.status.code(), Some(3));
        for part in named {
            assert!(
                errors(&output).contains(&part),
                "{part}: {}",
                errors(&output)
            );
        }
    }
}

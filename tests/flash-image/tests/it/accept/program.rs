//! `painleve accept` at one end of a pseudo-terminal, a bare board at the other.

use std::io::{Read, Write};
use std::process::{Output, Stdio};
use std::time::{Duration, Instant};

use painleve_chips::MILLISECOND;
use painleve_flash_image::board::{EmulatedBoard, F405};
use painleve_tests::Bench;
use painleve_tests::line::terminal;
use serde_json::Value;

use crate::accept::defect::Defect;
use crate::accept::{FIRST_SEED, board};
use crate::drive::rig::is_readable;

/// Longest time of the command, on a machine that is busy.
const LIMIT: Duration = Duration::from_secs(300);

/// Runs the command until it ends.
fn run(mut board: EmulatedBoard<F405>) -> (Bench, Output) {
    let (mut near, _far, port) = terminal();
    let folder = Bench::new("accept");
    let mut command = folder.command(&["accept", "--json", "--output", "report.html"]);
    command.arg("--port").arg(&port);
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    board.take_sent();
    let mut child = command.spawn().unwrap();
    let start = Instant::now();
    let mut due = start;
    let mut bytes = [0; 1024];
    while child.try_wait().unwrap().is_none() {
        assert!(start.elapsed() < LIMIT, "the command does not end");
        // As on a serial port, what the line has not carried yet waits with the sender: however slow the emulation is, the
        // command does not take the time of its own flood for the board's silence.
        while board.line_takes_more() && is_readable(&near) {
            let length = near.read(&mut bytes).unwrap();
            board.send_bytes(&bytes[..length]);
        }
        board.machine.run_for(MILLISECOND);
        near.write_all(&board.take_sent()).unwrap();
        due = (due + Duration::from_millis(1)).max(Instant::now());
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
    }
    (folder, child.wait_with_output().unwrap())
}

/// The report that the command prints, whose verdict is that of its exit code.
fn report(output: &Output) -> Value {
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let code = i32::from(report["verdict"] != "passed");
    let text = painleve_tests::errors(output);
    assert_eq!(output.status.code(), Some(code), "{text}");
    report
}

#[test]
fn the_command_fails_on_another_chip() {
    let (_folder, output) = run(board::<F405>(FIRST_SEED, Some(Defect::OtherChip)).board);
    let report = report(&output);
    assert_eq!(report["verdict"], "failed", "{report}");
    assert_eq!(output.status.code(), Some(1));
}

/// On a busy machine the emulated board is slower than real time, which steps by the host's clock may find.
#[test]
#[ignore = "takes longer than 20 s"]
fn the_command_writes_its_report() {
    let (folder, output) = run(board::<F405>(FIRST_SEED, None).board);
    let report = report(&output);
    let text = painleve_tests::errors(&output);
    let passed = |name: &str| {
        let steps = report["steps"].as_array().unwrap();
        let step = steps.iter().find(|it| it["name"] == name).unwrap();
        step["verdict"] == "passed"
    };
    for step in ["identity", "options", "ticks", "line", "enable"] {
        assert!(passed(step), "{step}: {text}");
    }
    let written = std::fs::read_to_string(folder.path("report.json")).unwrap();
    assert_eq!(report, serde_json::from_str::<Value>(&written).unwrap());
    let page = std::fs::read_to_string(folder.path("report.html")).unwrap();
    assert!(page.contains("STM32F405") && page.contains("measured"));
}

//! What viewers cost: ticks of a live run with and without them, size and frame rate of a run's page.

use std::fs;

use super::{Row, criterion, pinned};
use crate::bench::machine::Machine;
use crate::command::{ChoreError, starts, workspace};

/// Page of a run of 60 s.
const PAGE: &str = "target/bench/run-of-60-s.html";

/// Measures a live run with one viewer of each kind, and the page of a run of 60 s.
///
/// # Errors
/// If a benchmark fails.
pub fn rows(machine: &Machine, rows: &mut Vec<Row>) -> Result<(), ChoreError> {
    let every = machine.pinned(machine.count());
    let printed = criterion(&every, "painleve-command", "live")?;
    for (viewer, benchmark, bar) in [
        (
            "no viewer: ",
            "live run as fast as possible, without a viewer",
            "–",
        ),
        ("a page: ", "the same with one page", "95 %"),
        (
            "Foxglove, all topics: ",
            "the same with one Foxglove client, subscribed to every topic",
            "95 %",
        ),
    ] {
        let found = printed.lines().find_map(|line| line.strip_prefix(viewer));
        let measured = found.ok_or_else(|| ChoreError(format!("no line \"{viewer}\"")))?;
        rows.push(Row {
            benchmark: benchmark.into(),
            measured: measured.into(),
            bar,
        });
    }
    let run = [
        "run",
        "--no-record",
        "--quiet",
        "--plot",
        "target/bench/run.svg",
    ];
    let long = ["--set", "run.duration_s=60", "--html", PAGE];
    pinned(
        &every,
        "target/release/painleve",
        &[&run[..], &long].concat(),
    )?;
    let path = workspace().join(PAGE);
    let size = fs::metadata(&path).map_err(|cause| ChoreError(format!("{PAGE}: {cause}")))?;
    rows.push(Row {
        benchmark: "page of a run of 60 s".into(),
        measured: format!("{:.2} MB", 1e-6 * size.len() as f64),
        bar: "2 MB",
    });
    rows.push(Row {
        benchmark: "playing that page in headless Chromium, 1,200 × 900 pixels".into(),
        measured: if starts("node") && starts("chromium") {
            let script = ["tests/browser/frames.mjs", "chromium", PAGE];
            pinned(&every, "node", &script)?
        } else {
            "not measured: no node or no chromium".into()
        },
        bar: "60 frames/s",
    });
    Ok(())
}

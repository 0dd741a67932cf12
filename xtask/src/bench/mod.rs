//! Measures the figures of `docs/benchmarks.md` on this machine, and writes its table.
//!
//! Programs are pinned, and run one after the other. Figures are only comparable between machines
//! whose description in the document is the same; a busy machine lowers all of them.

mod machine;
mod samples;
mod viewers;

use std::fs;
use std::time::Instant;

use clap::Args;
use serde_json::Value;

use crate::command::{ChoreError, answer, cargo, run_cargo, say, workspace};
use crate::options::number;
use crate::size;
use machine::Machine;
use samples::Samples;

/// Document with the table, and the comments around it.
const DOCUMENT: &str = "docs/benchmarks.md";
const START: &str = "<!-- measured: bench -->";
const END: &str = "<!-- end -->";

#[derive(Debug, Args)]
pub struct BenchArguments {
    /// Runs of the robustness campaign.
    #[arg(long, default_value_t = 10_000, value_parser = runs)]
    runs: u32,
    /// Print the table without writing it to the document.
    #[arg(long)]
    dry_run: bool,
}

fn runs(text: &str) -> Result<u32, String> {
    number(text, 1..=10_000_000, "a number of runs")
}

/// The command.
const PAINLEVE: &str = "target/release/painleve";

/// A line of the table.
struct Row {
    benchmark: String,
    measured: String,
    bar: &'static str,
}

/// Measures everything and writes the table.
///
/// # Errors
/// If a benchmark fails, or the document has no place for the table.
pub fn run(arguments: &BenchArguments) -> Result<(), ChoreError> {
    let machine = Machine::here()?;
    run_cargo(&["build", "--release", "--package", "painleve-command"])?;
    let mut rows = Vec::new();
    plant(&machine, &mut rows)?;
    controller(&machine, &mut rows)?;
    link(&machine, &mut rows)?;
    programs(&machine, &mut rows)?;
    viewers::rows(&machine, &mut rows)?;
    campaign(arguments.runs, &machine, &mut rows)?;

    let mut table = format!(
        "{}\n\n| benchmark | measured | required |\n|---|---|---|\n",
        machine.described()
    );
    for row in rows {
        table += &format!("| {} | {} | {} |\n", row.benchmark, row.measured, row.bar);
    }
    say(&table)?;
    if arguments.dry_run {
        return Ok(());
    }
    let path = workspace().join(DOCUMENT);
    let failed = |cause: std::io::Error| ChoreError(format!("{DOCUMENT}: {cause}"));
    let text = fs::read_to_string(&path).map_err(failed)?;
    let text = with_table(&text, &table)
        .ok_or_else(|| ChoreError(format!("{DOCUMENT} lacks {START} and {END}")))?;
    fs::write(path, text).map_err(failed)
}

/// Returns the document with another table between its comments.
fn with_table(text: &str, table: &str) -> Option<String> {
    let (before, rest) = text.split_once(START)?;
    let (_, after) = rest.split_once(END)?;
    Some(format!("{before}{START}\n\n{table}\n{END}{after}"))
}

/// Runs a program on some processors and returns what it prints.
fn pinned(processors: &str, program: &str, arguments: &[&str]) -> Result<String, ChoreError> {
    let line = [&["-c", processors, program], arguments].concat();
    eprintln!("$ taskset {}", line.join(" "));
    answer("taskset", &line)
}

/// Runs a benchmark of a crate, after building it on all processors.
fn criterion(processors: &str, package: &str, bench: &str) -> Result<String, ChoreError> {
    let target = ["bench", "--quiet", "--package", package, "--bench", bench];
    run_cargo(&[&target[..], &["--no-run"]].concat())?;
    let short = [
        "--",
        "--warm-up-time",
        "1",
        "--measurement-time",
        "3",
        "--noplot",
    ];
    pinned(processors, &cargo(), &[&target[..], &short[..]].concat())
}

fn plant(machine: &Machine, rows: &mut Vec<Row>) -> Result<(), ChoreError> {
    criterion(&machine.pinned(1), "painleve-plant", "plant")?;
    for (identifier, benchmark, bar) in [
        (
            "plant/open-loop bouncing, 1 s",
            "plant, open-loop bouncing at v_belt = −0.4 m/s, relative tolerance 1e-9",
            "5,000, goal 10,000",
        ),
        ("plant/quiet sliding, 1 s", "plant, quiet sliding", "–"),
        (
            "plant/sliding with a torque every 1 ms, 1 s",
            "plant, sliding with a new torque every millisecond",
            "3,000",
        ),
        (
            "plant/on 1e5 N/m with a torque every 1 ms, 1 s",
            "plant, compliant contact of 1e5 N/m with a new torque every millisecond",
            "–",
        ),
    ] {
        let samples = Samples::of(identifier)?;
        rows.push(Row {
            benchmark: benchmark.into(),
            measured: format!(
                "{} simulated s per CPU s; {}",
                thousands(1.0 / samples.median_s()),
                samples.spread()
            ),
            bar,
        });
    }
    criterion(&machine.pinned(1), "painleve-study", "bifurcation")?;
    let mut cells = Vec::new();
    for count in [460, 910, 1810] {
        let samples = Samples::of(&format!("bifurcation/{count} cells"))?;
        cells.push(format!(
            "{:.3}",
            1e3 * samples.median_s() / f64::from(count)
        ));
    }
    rows.push(Row {
        benchmark: "bifurcation diagram, cost of a cell of 6 s for 460 / 910 / 1,810 cells".into(),
        measured: format!("{} ms of CPU time", cells.join(" / ")),
        bar: "the same",
    });
    Ok(())
}

fn controller(machine: &Machine, rows: &mut Vec<Row>) -> Result<(), ChoreError> {
    criterion(&machine.pinned(1), "painleve-plant", "controller")?;
    let mut ticks = Vec::new();
    for name in ["hybrid-elbow-down", "pid-elbow-down", "paper-gains"] {
        let samples = Samples::of(&format!("tick/{name}"))?;
        ticks.push(format!("{:.0}", 1e9 * samples.median_s()));
    }
    rows.push(Row {
        benchmark: "controller tick on this machine: hybrid / PID / 10 kHz paper gains".into(),
        measured: format!("{} ns", ticks.join(" / ")),
        bar: "1,000 ns",
    });
    let closed_loop = Samples::of("closed loop in one process, 1 s")?;
    rows.push(Row {
        benchmark: "closed loop in one process: plant, converters, controller and log hash".into(),
        measured: format!(
            "{:.2} µs per tick; {}",
            1e3 * closed_loop.median_s(),
            closed_loop.spread()
        ),
        bar: "0.6 µs",
    });
    Ok(())
}

fn link(machine: &Machine, rows: &mut Vec<Row>) -> Result<(), ChoreError> {
    let printed = criterion(&machine.pinned(2), "painleve-command", "link")?;
    let after = |key: &str| {
        let found = printed.lines().find_map(|line| line.strip_prefix(key));
        found
            .map(str::to_owned)
            .ok_or_else(|| ChoreError(format!("no line \"{key}\"")))
    };
    let (alone, lockstep) = (
        after("bare ping-pong of the frames: ")?,
        after("lockstep run, plant included: ")?,
    );
    let rate = |text: &str| -> f64 {
        let first = text.split(' ').next().unwrap_or_default();
        first.parse().unwrap_or(f64::NAN)
    };
    let events = after("eventfd on one processor: ")?;
    let crowded = after("lockstep run on one processor: ")?;
    let share = |part: &str, whole: &str| format!("{:.0} %", 100.0 * rate(part) / rate(whole));
    let (of_exchange, of_events) = (share(&lockstep, &alone), share(&crowded, &events));
    rows.push(Row {
        benchmark: "exchange of frames between two processes, without plant and controller".into(),
        measured: alone,
        bar: "–",
    });
    rows.push(Row {
        benchmark: "lockstep, including plant and controller".into(),
        measured: format!("{lockstep}; {of_exchange} of the exchange alone"),
        bar: "100,000 ticks/s; 40 %",
    });
    rows.push(Row {
        benchmark: "two processes on one processor that wake each other with an eventfd".into(),
        measured: events,
        bar: "–",
    });
    rows.push(Row {
        benchmark: "lockstep on one processor, including plant and controller".into(),
        measured: format!("{crowded}; {of_events} of the eventfd"),
        bar: "50 %",
    });
    Ok(())
}

fn programs(machine: &Machine, rows: &mut Vec<Row>) -> Result<(), ChoreError> {
    let bare = ["run", "--json", "--no-record", "--no-plot", "--set"];
    let measure = |duration_s: u32, more: &[&str]| {
        let duration = format!("run.duration_s={duration_s}");
        let arguments = [&bare[..], &[&duration], more].concat();
        let mut found = Vec::new();
        for _ in 0..3 {
            let report = pinned(&machine.pinned(2), PAINLEVE, &arguments)?;
            let report: Value = serde_json::from_str(&report)
                .map_err(|cause| ChoreError(format!("report of a run: {cause}")))?;
            found.push(report["realtime_factor"].as_f64().unwrap_or(f64::NAN));
        }
        found.sort_by(f64::total_cmp);
        Ok::<_, ChoreError>(found)
    };
    let ticks_s = measure(200, &[])?;
    let ticks_s: Vec<String> = ticks_s.iter().map(|it| thousands(1000.0 * it)).collect();
    rows.push(Row {
        benchmark: "`painleve run --no-record --no-plot`, 200 s simulated, three runs".into(),
        measured: format!("{} ticks/s", ticks_s.join(", ")),
        bar: "100,000 ticks/s",
    });
    let scenarios = pinned(&machine.pinned(1), PAINLEVE, &["scenarios", "--json"])?;
    let scenarios: Value = serde_json::from_str(&scenarios)
        .map_err(|cause| ChoreError(format!("list of scenarios: {cause}")))?;
    for (tick_hz, bar) in [("1000", "3, goal 6"), ("10000", "–")] {
        let rate = format!("run.tick_hz={tick_hz}");
        let mut slowest = (f64::INFINITY, String::new());
        for scenario in scenarios.as_array().into_iter().flatten() {
            let name = scenario["name"].as_str().unwrap_or_default();
            let more = [name, "--host", "qemu", "--set", &rate];
            for factor in measure(6, &more)? {
                if factor < slowest.0 {
                    slowest = (factor, name.to_owned());
                }
            }
        }
        let (factor, name) = slowest;
        rows.push(Row {
            benchmark: format!(
                "`painleve run --host qemu` at {tick_hz} Hz, 6 s simulated, slowest of all built-in scenarios, three runs each"
            ),
            measured: format!("{factor:.1} × real time, `{name}`"),
            bar,
        });
    }
    Ok(())
}

fn campaign(runs: u32, machine: &Machine, rows: &mut Vec<Row>) -> Result<(), ChoreError> {
    let start = Instant::now();
    let before_s = children_cpu_s();
    let number = runs.to_string();
    let arguments = ["study", "robustness", "--json", "--runs", &number];
    pinned(&machine.pinned(machine.count()), PAINLEVE, &arguments)?;
    let (wall_s, cpu_s) = (start.elapsed().as_secs_f64(), children_cpu_s() - before_s);
    rows.push(Row {
        benchmark: format!(
            "{} runs of the [robustness campaign](studies.md#robustness) on {} processors",
            thousands(f64::from(runs)),
            machine.count()
        ),
        measured: format!(
            "{wall_s:.1} s; {cpu_s:.1} s of CPU time, {:.1} ms a run",
            1e3 * cpu_s / f64::from(runs)
        ),
        bar: "60 s for 10,000 on four",
    });
    Ok(())
}

/// CPU time of all programs that have ended, s.
fn children_cpu_s() -> f64 {
    use nix::sys::resource::{UsageWho, getrusage};
    use nix::sys::time::TimeValLike;
    getrusage(UsageWho::RUSAGE_CHILDREN).map_or(f64::NAN, |usage| {
        1e-6 * (usage.user_time() + usage.system_time()).num_microseconds() as f64
    })
}

/// Returns a whole number with separators, in three digits that mean something.
fn thousands(value: f64) -> String {
    let scale = 10_f64.powf((value.log10().floor() - 2.0).max(0.0));
    size::thousands(((value / scale).round() * scale) as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_replaces_the_one_between_its_comments() {
        let text = format!("a\n{START}\nold\n{END}\nb {END}");
        let new = with_table(&text, "new\n").unwrap();
        assert_eq!(new, format!("a\n{START}\n\nnew\n\n{END}\nb {END}"));
        assert!(with_table("a", "new").is_none());
    }

    #[test]
    fn numbers_have_three_digits_and_separators() {
        assert_eq!(thousands(4163.2), "4,160");
        assert_eq!(thousands(528_987.0), "529,000");
        assert_eq!(thousands(42.4), "42");
        assert_eq!(thousands(10_000.0), "10,000");
    }
}

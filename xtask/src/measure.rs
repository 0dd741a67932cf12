//! Measures the figures that the documentation prints.
//!
//! Each file of `docs/measured/` declares its entries: a name, a label for tables, the command, and which fields of the
//! command's JSON are kept. This chore executes the commands and writes each `result` into its file as soon as it is
//! finished. An entry that the present sources have measured is skipped, so that an interrupted measurement goes on
//! where it stopped. The pages then take their figures from these files.

use std::collections::HashMap;
use std::collections::hash_map::Entry::{Occupied, Vacant};
use std::fs;
use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::Value;
use toml::Table;

use crate::command::{ChoreError, answer, cargo, run_with, say, workspace};
use crate::under_test::{PROFILE, build_program, program, run_tests};

#[derive(Debug, Args)]
pub struct MeasureArguments {
    /// Files (`robustness`), entries (`robustness.rigid`), or ticks, bound, bench, figures; all by default.
    names: Vec<String>,
    /// A twentieth of the runs of every campaign, for a first look: prints the results and writes nothing.
    #[arg(long)]
    quick: bool,
    /// Measure entries again that the present sources have measured.
    #[arg(long)]
    again: bool,
    /// List the entries and which of them are missing, and measure nothing.
    #[arg(long)]
    list: bool,
}

const HEAD: &str = "# Names, labels, commands and `keep` are written by hand, each `result` by `cargo xtask measure`.\n\n";

/// Tests that write figures into the pages: the name here, and what the tests' names contain. They compare them in every
/// run.
const BLOCKS: [(&str, &str); 6] = [
    ("ticks", "with_the_same_counts_within_budget"),
    ("bound", "a_tick_has_bounds_within_the_budget"),
    ("worst-ticks", "the_worst_readings_found_by_a_search"),
    ("release", "ticks_begin_within_the_bound_after"),
    ("stuck-sensors", "a_stuck_sensor_does_what_the_page_says"),
    ("control-rates", "a_board_accepts_the_control_rates_that"),
];

/// The tests among which these are. Of the whole workspace: a package by itself would be compiled with other features, and
/// its dependencies again.
const TESTS: [&str; 3] = ["--workspace", "--test", "it"];

/// The tests that write the figures of `docs/measured/` into the pages, draw them, and list the settings.
const PAGES: [&str; 3] = [
    "generated_parts_and_measured_figures_are_up_to_date",
    "documentation_draws_the_trade_off_as_measured",
    "the_list_of_settings_is_up_to_date",
];

/// The chore that measures times beside those of others.
const BENCH: &str = "bench";

/// The commands that draw the pages' figures of results, named `figures`.
const FIGURES: [&str; 6] = [
    "run edge --no-record --plot docs/images/edge.svg",
    "run capture --no-record --plot docs/images/capture.svg",
    "study sliding-range --mu 0.4,0.6,0.8 --reference minimum-jerk:3,ramp:2 --svg docs/images/sliding-range.svg",
    "study lift-off --seed 7001508 --runs 1200 --svg docs/images/lift-off.svg",
    "study stiffness --svg docs/images/stiffness.svg",
    "study ringing --svg docs/images/ringing.svg",
];

/// A file of entries.
struct Measured {
    path: PathBuf,
    name: String,
    table: Table,
}

/// Measures what is missing.
///
/// # Errors
/// If a name is unknown, a file is malformed, a command fails, or a result cannot be written.
pub fn run(arguments: &MeasureArguments) -> Result<(), ChoreError> {
    let mut files = read_files()?;
    check_names(&arguments.names, &files)?;
    let is_named = |name: &str| {
        let file = name.split('.').next();
        let names = &arguments.names;
        names.is_empty()
            || names
                .iter()
                .any(|it| it == name || Some(it.as_str()) == file)
    };
    build_program()?;
    let here = Here::new()?;
    let mut answers = HashMap::new();
    for file in &mut files {
        for place in 0..file.entries()?.len() {
            let entry = file.entry(place)?;
            let whole = format!("{}.{}", file.name, text(&entry, "name")?);
            if !is_named(&whole) {
                continue;
            }
            let command = text(&entry, "command")?.to_owned();
            let source = entry.get("result").and_then(|result| result.get("source"));
            let is_finished = source.and_then(toml::Value::as_str) == Some(&here.source);
            if arguments.list {
                let state = if is_finished { "measured" } else { "missing" };
                say(&format!("{whole}: {state}"))?;
                continue;
            }
            if is_finished && !arguments.again && !arguments.quick {
                continue;
            }
            let command = if arguments.quick {
                with_fewer_runs(&command)
            } else {
                command
            };
            let answer = match answers.entry(command) {
                Occupied(known) => known.into_mut(),
                Vacant(place) => {
                    let answer = here.answer(place.key())?;
                    place.insert(answer)
                }
            };
            let result = here.result(&entry, answer)?;
            say(&format!("# {whole}\n{result}"))?;
            if !arguments.quick {
                file.keep(place, result)?;
            }
        }
    }
    if arguments.list || arguments.quick {
        return Ok(());
    }
    if is_named("figures") {
        for figure in FIGURES {
            let arguments: Vec<&str> = figure.split(' ').collect();
            run_with(&program().to_string_lossy(), &arguments, &[])?;
        }
    }
    let environment = [("UPDATE_DOCUMENTATION", "1")];
    for (_, test) in BLOCKS.iter().filter(|(name, _)| is_named(name)) {
        run_tests(&TESTS, &[test], &[], &environment)?;
    }
    if is_named(BENCH) {
        run_with(&cargo(), &["xtask", BENCH], &environment)?;
    }
    // Not with `run_tests`: this needs no image, and so no compiler for boards.
    let test = ["test", "--profile", PROFILE];
    run_with(
        &cargo(),
        &[&test[..], &TESTS, &["--"], &PAGES].concat(),
        &environment,
    )
}

fn read_files() -> Result<Vec<Measured>, ChoreError> {
    let folder = workspace().join("docs/measured");
    let failed = |path: &Path, cause: &dyn std::fmt::Display| {
        ChoreError(format!("{}: {cause}", path.display()))
    };
    let mut files = Vec::new();
    for entry in fs::read_dir(&folder).map_err(|cause| failed(&folder, &cause))? {
        let path = entry.map_err(|cause| failed(&folder, &cause))?.path();
        let Some(name) = path
            .file_name()
            .and_then(|name| name.to_str()?.strip_suffix(".toml"))
        else {
            continue;
        };
        let text = fs::read_to_string(&path).map_err(|cause| failed(&path, &cause))?;
        let table = text
            .parse::<Table>()
            .map_err(|cause| failed(&path, &cause))?;
        let name = name.to_owned();
        files.push(Measured { path, name, table });
    }
    files.sort_by(|one, other| one.name.cmp(&other.name));
    Ok(files)
}

fn check_names(names: &[String], files: &[Measured]) -> Result<(), ChoreError> {
    let mut known: Vec<String> = BLOCKS.iter().map(|(name, _)| (*name).into()).collect();
    known.extend([BENCH.into(), "figures".into()]);
    for file in files {
        for place in 0..file.entries()?.len() {
            known.push(format!(
                "{}.{}",
                file.name,
                text(&file.entry(place)?, "name")?
            ));
        }
        known.push(file.name.clone());
    }
    let Some(name) = names.iter().find(|name| !known.contains(name)) else {
        return Ok(());
    };
    let whole = known
        .iter()
        .map(String::as_str)
        .filter(|name| !name.contains('.'));
    let allowed = whole.collect::<Vec<_>>().join(", ");
    Err(ChoreError(format!(
        "unknown name '{name}'; allowed: {allowed}, or FILE.ENTRY as `--list` prints it"
    )))
}

impl Measured {
    fn entries(&self) -> Result<&Vec<toml::Value>, ChoreError> {
        let entries = self.table.get("measured").and_then(toml::Value::as_array);
        entries.ok_or_else(|| ChoreError(format!("{} has no [[measured]]", self.path.display())))
    }

    fn entry(&self, place: usize) -> Result<Table, ChoreError> {
        let entry = self.entries()?[place].as_table().cloned();
        entry.ok_or_else(|| ChoreError(format!("{}: [[measured]] is a table", self.path.display())))
    }

    /// Writes the result of an entry. The file is renamed into place, so that it is never half written.
    fn keep(&mut self, place: usize, result: Table) -> Result<(), ChoreError> {
        let entries = self
            .table
            .get_mut("measured")
            .and_then(toml::Value::as_array_mut);
        let entry = entries.and_then(|entries| entries.get_mut(place)?.as_table_mut());
        entry.map(|entry| entry.insert("result".into(), result.into()));
        let partial = self.path.with_extension("partial");
        fs::write(&partial, format!("{HEAD}{}", self.table))
            .and_then(|()| fs::rename(&partial, &self.path))
            .map_err(|cause| ChoreError(format!("{}: {cause}", self.path.display())))
    }
}

/// Returns a text of an entry.
fn text<'a>(entry: &'a Table, key: &str) -> Result<&'a str, ChoreError> {
    let text = entry.get(key).and_then(toml::Value::as_str);
    text.ok_or_else(|| ChoreError(format!("an entry has no {key}: {entry}")))
}

/// Returns a command with a twentieth of its runs.
fn with_fewer_runs(command: &str) -> String {
    let Some((before, after)) = command.split_once("--runs ") else {
        return command.into();
    };
    let digits = after
        .find(|c: char| !c.is_ascii_digit())
        .unwrap_or(after.len());
    let runs = after[..digits].parse().unwrap_or(0_u64);
    format!("{before}--runs {}{}", (runs / 20).max(5), &after[digits..])
}

/// This machine and these sources.
struct Here {
    /// Hash of the sources of the controller.
    source: String,
    commit: String,
    date: String,
    machine: String,
}

/// Returns the commit, with `-dirty` if anything but results and the pages that display them differs from it: measuring one
/// table after another needs no commit in between.
fn commit() -> Result<String, ChoreError> {
    let commit = answer("git", &["describe", "--always", "--exclude=*"])?;
    let paths = ["--", ":/", ":(top,exclude)docs", ":(top,exclude)README.md"];
    let status = ["status", "--porcelain", "--untracked-files=no"];
    let changed = answer("git", &[&status[..], &paths].concat())?;
    Ok(if changed.is_empty() {
        commit
    } else {
        commit + "-dirty"
    })
}

impl Here {
    fn new() -> Result<Self, ChoreError> {
        let mut here = Self {
            source: String::new(),
            commit: commit()?,
            date: answer("date", &["--iso-8601=date"])?,
            machine: machine(),
        };
        let doctor = here.answer("painleve doctor --json")?;
        let version = doctor["version"].as_str().unwrap_or_default();
        here.source = version.rsplit(' ').next().unwrap_or_default().into();
        Ok(here)
    }

    /// Executes a command and returns the object that it prints; `painleve` is the program under test.
    fn answer(&self, command: &str) -> Result<Value, ChoreError> {
        eprintln!("$ {command}");
        let mut words = command.split_whitespace();
        let name = words.next().unwrap_or_default();
        let built = program();
        let started = if name == "painleve" {
            built.to_string_lossy()
        } else {
            name.into()
        };
        let printed = answer(&started, &words.collect::<Vec<_>>())?;
        serde_json::from_str(&printed).map_err(|cause| ChoreError(format!("`{command}`: {cause}")))
    }

    /// Returns the result of an entry: what it keeps of the answer, and where it comes from.
    fn result(&self, entry: &Table, answer: &Value) -> Result<Table, ChoreError> {
        let mut result = Table::new();
        let keep = entry.get("keep").and_then(toml::Value::as_table);
        for (key, at) in keep.into_iter().flatten() {
            let at = at.as_str().unwrap_or_default();
            let value = answer.pointer(at);
            let value = value.ok_or_else(|| {
                ChoreError(format!(
                    "{}: no '{at}' in the JSON",
                    text(entry, "name").unwrap_or_default()
                ))
            })?;
            // TOML has no null: what a run does not have is left out.
            if !value.is_null() {
                let value = converted(value)
                    .ok_or_else(|| ChoreError(format!("'{at}' is neither number nor text")))?;
                result.insert(key.clone(), value);
            }
        }
        let count = |key: &str| result.get(key).and_then(toml::Value::as_integer);
        if let (Some(successes), Some(runs)) = (count("successes"), count("runs")) {
            let (lower, upper) = wilson_percent(successes as f64, runs as f64);
            result.insert("lower_percent".into(), lower.into());
            result.insert("upper_percent".into(), upper.into());
        }
        for (key, value) in [
            ("source", &self.source),
            ("commit", &self.commit),
            ("date", &self.date),
            ("machine", &self.machine),
        ] {
            result.insert(key.into(), value.as_str().into());
        }
        Ok(result)
    }
}

/// Returns a number or text of JSON for TOML.
fn converted(value: &Value) -> Option<toml::Value> {
    let whole = value.as_i64().map(toml::Value::Integer);
    let text = || value.as_str().map(|text| toml::Value::String(text.into()));
    let float = || value.as_f64().map(toml::Value::Float);
    whole.or_else(float).or_else(text)
}

/// Returns the interval of Wilson at 95 %, in percent with three decimals.
fn wilson_percent(successes: f64, runs: f64) -> (f64, f64) {
    let (k, n, z) = (successes, runs, 1.959_964_f64);
    let centre = (k + z * z / 2.0) / (n + z * z);
    let half = z / (n + z * z) * (k * (n - k) / n + z * z / 4.0).sqrt();
    let percent = |share: f64| (share.clamp(0.0, 1.0) * 100_000.0).round() / 1000.0;
    (percent(centre - half), percent(centre + half))
}

fn machine() -> String {
    let text = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = text
        .lines()
        .find_map(|line| line.strip_prefix("model name"));
    let model = model.map_or("unknown", |value| {
        value.trim_start_matches([':', ' ', '\t'])
    });
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    format!("{model}, {processors} processors")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interval_is_that_of_the_studies() {
        // `painleve study robustness --runs 40 --seed 7` printed 38 of 40, 0.8349612 to 0.9861793.
        assert_eq!(wilson_percent(38.0, 40.0), (83.496, 98.618));
        assert_eq!(wilson_percent(4.0, 4.0), (51.011, 100.0));
    }

    #[test]
    fn a_first_look_takes_a_twentieth_of_the_runs() {
        assert_eq!(
            with_fewer_runs("painleve study capture --runs 1000 --json"),
            "painleve study capture --runs 50 --json"
        );
        assert_eq!(with_fewer_runs("painleve run edge"), "painleve run edge");
    }

    /// Pictures that `figures` does not draw, and where they come from.
    const OTHER_PICTURES: [(&str, &str); 15] = [
        ("smoothness", "a test draws it from docs/measured"),
        (
            "work-precision",
            "a test draws it from its benchmark's rows",
        ),
        ("bounce", "docs/images/bounce.py"),
        ("ablation", "the lab book"),
        ("effects-rigid", "the lab book"),
        ("effects-compliant", "the lab book"),
        ("identified", "a test draws it from a rehearsal"),
        ("arm", "by hand"),
        ("arm-measures", "by hand"),
        ("commissioning", "by hand"),
        ("set-down", "by hand"),
        ("tick", "by hand"),
        ("wiring", "by hand"),
        ("wiring-bare-board", "by hand"),
        ("wiring-two-sensors", "by hand"),
    ];

    #[test]
    fn every_picture_has_something_that_draws_it() {
        let drawn = FIGURES.iter().map(|it| it.rsplit('/').next().unwrap_or(it));
        let others = OTHER_PICTURES.iter().map(|(name, _)| format!("{name}.svg"));
        let mut known: Vec<String> = drawn.map(String::from).chain(others).collect();
        known.sort();
        let folder = fs::read_dir(workspace().join("docs/images")).expect("pictures");
        let names = folder.map(|entry| entry.expect("a picture").file_name());
        let names = names.map(|name| name.to_string_lossy().into_owned());
        let mut present: Vec<String> = names.filter(|name| name.ends_with(".svg")).collect();
        present.sort();
        assert_eq!(present, known);
    }

    #[test]
    fn every_file_declares_entries_with_names_of_their_own() {
        for file in read_files().unwrap_or_else(|error| panic!("{error}")) {
            let mut names = Vec::new();
            let count = file.entries().map_or(0, |entries| entries.len());
            for place in 0..count {
                let entry = file.entry(place).unwrap_or_else(|error| panic!("{error}"));
                for key in ["label", "command"] {
                    assert!(text(&entry, key).is_ok(), "{}: {key}", file.name);
                }
                assert!(
                    entry.get("keep").is_some_and(toml::Value::is_table),
                    "{}: without `keep` this is copied by hand: {entry}",
                    file.name
                );
                names.extend(text(&entry, "name").map(str::to_owned));
            }
            names.sort();
            names.dedup();
            assert!(
                count > 0 && names.len() == count,
                "{}: {names:?}",
                file.name
            );
        }
    }
}

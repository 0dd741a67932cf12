//! `painleve tune`: searches keys of a scenario for a smaller error, ripple and change of torque.

use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use clap::Args;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use painleve_chart::picture;
use painleve_files::atomic_file::{self, AtomicFile, commit_all, prepare};
use painleve_files::input_file;
use painleve_plant::scenario::Scenario;
use painleve_process::interrupt::Interrupt;
use painleve_process::terminal::{self, warn};
use painleve_study_core::options::number;
use painleve_study_quality::tuning::{BATCH, Range, Score, Trial, Tuning, svg};
use serde_json::json;

use super::json::JsonOption;
use super::output_error::{InputError, output};
use super::study::outcome::Threads;
use super::{CommandError, distinct_files};

/// Options of `painleve tune`.
#[derive(Debug, Args)]
pub struct TuneArguments {
    /// Built-in scenario or scenario file to start from.
    scenario: String,
    /// A key with fractional values and their range, searched on a logarithmic scale; may be repeated.
    #[arg(long = "key", value_name = "KEY=FROM:TO", required = true)]
    keys: Vec<Range>,
    /// Override one key, for example belt.friction=0.4; may be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    /// Number of trials, 8 to 100000.
    #[arg(long, value_name = "N", default_value_t = 120, value_parser = |text: &str| number(text, 8_u32..=100_000, "a whole number"))]
    trials: u32,
    /// Cases of a trial: other friction, other masses than the controller's model has, other noise.
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = |text: &str| number(text, 1_u32..=1000, "a whole number"))]
    cases: u32,
    /// Seed of search and cases.
    #[arg(long, default_value_t = 1, value_parser = painleve_study_core::options::seed)]
    seed: u64,
    /// The tuned scenario.
    #[arg(long, value_name = "PATH", default_value = "out/tuned.toml")]
    out: PathBuf,
    /// Table of all trials; one that exists is continued.
    #[arg(long, value_name = "PATH", default_value = "out/tune.csv")]
    table: PathBuf,
    /// Figure of all trials: an SVG, PNG or PDF file, by its extension.
    #[arg(long, value_name = "PATH", default_value = "out/tune.svg", value_parser = super::figure_path())]
    plot: PathBuf,
    #[command(flatten)]
    threads: Threads,
    #[command(flatten)]
    json: JsonOption,
}

/// Searches, checks the best trial in cases that the search has not seen, and writes the tuned scenario.
///
/// # Errors
/// [`CommandError`] if the scenario or a key is invalid, the table belongs to another search, or an output cannot be
/// written.
pub fn run(arguments: &TuneArguments) -> Result<(), CommandError> {
    arguments.threads.in_pool(|| search(arguments))?
}

fn search(arguments: &TuneArguments) -> Result<(), CommandError> {
    check_keys(&arguments.keys)?;
    let interrupt = Interrupt::catch()?;
    let tuning = Tuning {
        scenario: Scenario::load(&arguments.scenario, &arguments.overrides)?,
        ranges: arguments.keys.clone(),
        cases: arguments.cases as usize,
        seed: arguments.seed,
        interrupt: interrupt.clone(),
    };
    tuning.check()?;
    distinct_files::check(&[
        ("--out", &arguments.out),
        ("--table", &arguments.table),
        ("--plot", &arguments.plot),
    ])?;
    // Held to the end, so that another search of the same table is refused.
    let held = AtomicFile::create(&arguments.table).map_err(output)?;
    held.check_alone().map_err(output)?;
    let given = tuning.score(&tuning.scenario, tuning.cases, tuning.seed)?;
    let trials = searched(arguments, &tuning, &given)?;
    let best = trials
        .iter()
        .min_by(|one, other| one.cost.total_cmp(&other.cost));
    // There are at least eight trials.
    let Some(best) = best else { return Ok(()) };
    let tuned = tuning.with(&best.values)?;
    // Cases that the search has not seen.
    let unseen =
        |scenario: &Scenario| tuning.score(scenario, 4 * tuning.cases, tuning.seed.wrapping_add(1));
    let held_out = [unseen(&tuning.scenario)?, unseen(&tuned)?];
    go_on(&interrupt)?;
    let held_out_cost = held_out[1].cost(&held_out[0]);
    let is_better =
        held_out_cost < held_out[0].cost(&held_out[0]) && held_out[1].kept >= held_out[0].kept;
    let figure = picture::encoded(&arguments.plot, svg(&trials, &given, best)).map_err(output)?;
    commit_all(vec![
        prepare(&arguments.out, tuned.to_brief_toml().as_bytes()).map_err(output)?,
        prepare(&arguments.plot, &figure).map_err(output)?,
    ])
    .map_err(output)?;
    let keys = arguments
        .keys
        .iter()
        .zip(&best.values)
        .map(|(range, value)| (range.key.clone(), *value));
    let files =
        [&arguments.out, &arguments.table, &arguments.plot].map(|path| path.display().to_string());
    let result = json!({
        "values": keys.clone().collect::<std::collections::BTreeMap<_, _>>(),
        "cost": best.cost,
        "held_out_cost": held_out_cost,
        "is_better": is_better,
        "given": given, "tuned": best.score,
        "held_out_given": held_out[0], "held_out_tuned": held_out[1],
        "files": files,
    });
    let lines = compared([
        ("given", &given, given.cost(&given)),
        ("tuned", &best.score, best.cost),
        (
            "given, unseen cases",
            &held_out[0],
            held_out[0].cost(&held_out[0]),
        ),
        ("tuned, unseen cases", &held_out[1], held_out_cost),
    ]);
    let keys: String = keys
        .map(|(key, value)| format!("\n{key} = {value:.6}"))
        .collect();
    let verdict = if is_better {
        "better"
    } else {
        "not better: keep the given settings"
    };
    arguments.json.say(
        &result,
        format_args!(
            "{lines}{keys}\nin cases that the search has not seen: {verdict}\nwrote {}",
            arguments.out.display()
        ),
    )
}

/// Returns all trials of a search, and writes their table after each batch.
fn searched(
    arguments: &TuneArguments,
    tuning: &Tuning,
    given: &Score,
) -> Result<Vec<Trial>, CommandError> {
    let all = arguments.trials as usize;
    let mut trials = continued(&arguments.table, tuning, given, all)?;
    let progress = progress(all, trials.len());
    while trials.len() < all {
        trials.extend(tuning.next_trials(&trials, all, given)?);
        go_on(&tuning.interrupt)?;
        progress.set_position(trials.len() as u64);
        atomic_file::write(&arguments.table, &table(tuning, &trials)?).map_err(output)?;
    }
    progress.finish_and_clear();
    Ok(trials)
}

/// Returns scores with their costs as a table.
fn compared(rows: [(&str, &Score, f64); 4]) -> String {
    let mut lines = terminal::table([
        "",
        "kept",
        "error (mm)",
        "ripple (N)",
        "torque change (N·m)",
        "cost",
    ]);
    for (name, score, cost) in rows {
        let numbers = [score.error_mm, score.ripple_n, score.torque_change_nm, cost]
            .map(|number| format!("{number:.4}"));
        let mut cells = vec![name.to_owned(), format!("{:.0} %", 100.0 * score.kept)];
        cells.extend(numbers);
        lines.add_row(cells);
    }
    terminal::readable_table(lines)
}

/// Refuses a key that is given twice: only the last of its values would count.
fn check_keys(ranges: &[Range]) -> Result<(), InputError> {
    for (index, Range { key, .. }) in ranges.iter().enumerate() {
        if ranges[..index].iter().any(|range| range.key == *key) {
            return Err(InputError::RepeatedKey { key: key.clone() });
        }
    }
    Ok(())
}

/// Ends an interrupted search, before it writes what its last cases have scored.
fn go_on(interrupt: &Interrupt) -> Result<(), CommandError> {
    match interrupt.is_requested() {
        true => Err(CommandError::Interrupted),
        false => Ok(()),
    }
}

fn progress(all: usize, done: usize) -> ProgressBar {
    let progress = ProgressBar::with_draw_target(Some(all as u64), ProgressDrawTarget::stderr());
    if let Ok(style) = ProgressStyle::with_template("{wide_bar} {pos}/{len} trials, {eta} left") {
        progress.set_style(style);
    }
    progress.set_position(done as u64);
    progress
}

/// Columns of the table after those of the keys.
const SCORES: [&str; 5] = ["kept", "error_mm", "ripple_n", "torque_change_nm", "cost"];

fn header(tuning: &Tuning) -> impl Iterator<Item = &str> {
    let keys = tuning.ranges.iter().map(|range| range.key.as_str());
    keys.chain(SCORES)
}

/// Returns the table of trials; trial 0 of a table is the given scenario.
fn table(tuning: &Tuning, trials: &[Trial]) -> Result<Vec<u8>, CommandError> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(header(tuning)).map_err(output)?;
    for trial in trials {
        let Score {
            kept,
            error_mm,
            ripple_n,
            torque_change_nm,
        } = trial.score;
        let scores = [kept, error_mm, ripple_n, torque_change_nm, trial.cost];
        let numbers = trial.values.iter().copied().chain(scores);
        writer
            .write_record(numbers.map(|number| format!("{number:?}")))
            .map_err(output)?;
    }
    writer
        .into_inner()
        .map_err(|error| output(csv::Error::from(error.into_error())))
}

/// Returns the trials of a table that this search has begun; none if there is no table.
fn continued(
    path: &Path,
    tuning: &Tuning,
    given: &Score,
    all: usize,
) -> Result<Vec<Trial>, CommandError> {
    if !path.exists() {
        return Ok(Vec::new());
    }
    let foreign = |reason| InputError::OtherSearch {
        path: path.to_path_buf(),
        reason,
    };
    let text = input_file::read(path).map_err(|error| foreign(error.to_string()))?;
    let mut trials = trials(&text, tuning, given).map_err(foreign)?;
    trials.truncate(all);
    // The last trial is computed again: the same search gives it again, to the last digit.
    let known = trials.len().saturating_sub(1);
    let batch = known - known % BATCH;
    if !trials.is_empty() {
        let again = tuning.next_trials(&trials[..batch], all, given)?;
        go_on(&tuning.interrupt)?;
        if again
            .iter()
            .zip(&trials[batch..])
            .any(|(one, other)| one != other)
        {
            let reason = "with this scenario, --key, --cases and --seed its last trials differ";
            return Err(foreign(reason.into()).into());
        }
        warn(format_args!(
            "continues {} after {} trials",
            path.display(),
            trials.len()
        ));
    }
    Ok(trials)
}

/// Reads the table of a search.
///
/// # Errors
/// What shows that it is the table of another one, or none.
fn trials(text: &str, tuning: &Tuning, given: &Score) -> Result<Vec<Trial>, String> {
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let found = reader.headers().map_err(|error| error.to_string())?;
    if !found.iter().eq(header(tuning)) {
        let columns: Vec<&str> = header(tuning).collect();
        return Err(format!("its first line is not '{}'", columns.join(",")));
    }
    let mut trials = Vec::new();
    for (line, row) in (2_usize..).zip(reader.records()) {
        let row = row.map_err(|error| error.to_string())?;
        let trial = trial(&row, tuning, given);
        trials.push(trial.map_err(|reason| format!("line {line}: {reason}"))?);
    }
    Ok(trials)
}

/// Reads a trial, whose cost must be that of its scores.
fn trial(row: &csv::StringRecord, tuning: &Tuning, given: &Score) -> Result<Trial, String> {
    let number = |(name, text): (&str, &str), range: RangeInclusive<f64>| {
        let number = text.parse().ok().filter(|number| range.contains(number));
        let (from, to) = (range.start(), range.end());
        number.ok_or_else(|| format!("{name} = {text} is not a number from {from} to {to}"))
    };
    let mut cells = header(tuning).zip(row);
    let keys = tuning.ranges.iter().zip(cells.by_ref());
    let values = keys.map(|(range, cell)| number(cell, range.from..=range.to));
    let values = values.collect::<Result<Vec<f64>, _>>()?;
    let mut score = |most| number(cells.next().unwrap_or_default(), 0.0..=most);
    let score = Score {
        kept: score(1.0)?,
        error_mm: score(f64::INFINITY)?,
        ripple_n: score(f64::INFINITY)?,
        torque_change_nm: score(f64::INFINITY)?,
    };
    let cost = score.cost(given);
    let (name, text) = cells.next().unwrap_or_default();
    if text.parse() == Ok(cost) {
        return Ok(Trial {
            values,
            score,
            cost,
        });
    }
    Err(format!(
        "{name} = {text}, but in this search its scores cost {cost:?}"
    ))
}

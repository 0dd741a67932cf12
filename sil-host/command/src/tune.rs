//! `painleve tune`: searches keys of a scenario for a smaller error, ripple and change of torque.

use std::path::{Path, PathBuf};

use clap::Args;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use painleve_chart::picture;
use painleve_files::atomic_file::{self, commit_all, prepare};
use painleve_files::input_file;
use painleve_plant::scenario::Scenario;
use painleve_process::terminal::{self, warn};
use painleve_study_quality::tuning::{BATCH, Range, Score, Trial, Tuning, svg};
use serde_json::json;

use super::json::JsonOption;
use super::output_error::{InputError, output};
use super::{CommandError, distinct_files};

/// Options of `painleve tune`.
#[derive(Debug, Args)]
pub struct TuneArguments {
    /// Built-in scenario or scenario file to start from.
    scenario: String,
    /// A key and the range of its values, searched on a logarithmic scale; may be repeated.
    #[arg(long = "key", value_name = "KEY=FROM:TO", required = true)]
    keys: Vec<Range>,
    /// Override one key, for example belt.friction=0.4; may be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    /// Number of trials.
    #[arg(long, value_name = "N", default_value_t = 120, value_parser = clap::value_parser!(u32).range(8..=100_000))]
    trials: u32,
    /// Cases of a trial: other friction, other masses than the controller's model has, other noise.
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=1000))]
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
    json: JsonOption,
}

/// Searches, checks the best trial in cases that the search has not seen, and writes the tuned scenario.
///
/// # Errors
/// [`CommandError`] if the scenario or a key is invalid, the table belongs to another search, or an output cannot be
/// written.
pub fn run(arguments: &TuneArguments) -> Result<(), CommandError> {
    let tuning = Tuning {
        scenario: Scenario::load(&arguments.scenario, &arguments.overrides)?,
        ranges: arguments.keys.clone(),
        cases: arguments.cases as usize,
        seed: arguments.seed,
    };
    tuning.check()?;
    distinct_files::check(&[
        ("--out", &arguments.out),
        ("--table", &arguments.table),
        ("--plot", &arguments.plot),
    ])?;
    let given = tuning.score(&tuning.scenario, tuning.cases, tuning.seed)?;
    let all = arguments.trials as usize;
    let mut trials = continued(&arguments.table, &tuning, &given, all)?;
    let progress = progress(all, trials.len());
    while trials.len() < all {
        trials.extend(tuning.next_trials(&trials, all, &given)?);
        progress.set_position(trials.len() as u64);
        atomic_file::write(&arguments.table, &table(&tuning, &trials)?).map_err(output)?;
    }
    progress.finish_and_clear();
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
    let held_out_cost = held_out[1].cost(&held_out[0]);
    let is_better = held_out_cost < 1.0 && held_out[1].kept >= held_out[0].kept;
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
    let mut lines = terminal::table([
        "",
        "kept",
        "error (mm)",
        "ripple (N)",
        "torque change (N·m)",
        "cost",
    ]);
    for (name, score, cost) in [
        ("given", &given, given.cost(&given)),
        ("tuned", &best.score, best.cost),
        (
            "given, unseen cases",
            &held_out[0],
            held_out[0].cost(&held_out[0]),
        ),
        ("tuned, unseen cases", &held_out[1], held_out_cost),
    ] {
        let numbers = [score.error_mm, score.ripple_n, score.torque_change_nm, cost]
            .map(|number| format!("{number:.4}"));
        let mut cells = vec![name.to_owned(), format!("{:.0} %", 100.0 * score.kept)];
        cells.extend(numbers);
        lines.add_row(cells);
    }
    let keys: String = keys
        .map(|(key, value)| format!("\n{key} = {value:.6}"))
        .collect();
    let verdict = if is_better {
        "better"
    } else {
        "not better: keep the given settings"
    };
    let lines = terminal::readable_table(lines);
    arguments.json.say(
        &result,
        format_args!(
            "{lines}{keys}\nin cases that the search has not seen: {verdict}\nwrote {}",
            arguments.out.display()
        ),
    )
}

fn progress(all: usize, done: usize) -> ProgressBar {
    let progress = ProgressBar::with_draw_target(Some(all as u64), ProgressDrawTarget::stderr());
    if let Ok(style) = ProgressStyle::with_template("{wide_bar} {pos}/{len} trials, {eta} left") {
        progress.set_style(style);
    }
    progress.set_position(done as u64);
    progress
}

/// Returns the table of trials; trial 0 of a table is the given scenario.
fn table(tuning: &Tuning, trials: &[Trial]) -> Result<Vec<u8>, CommandError> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let keys = tuning.ranges.iter().map(|range| range.key.as_str());
    let scores = ["kept", "error_mm", "ripple_n", "torque_change_nm", "cost"];
    writer.write_record(keys.chain(scores)).map_err(output)?;
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
    let foreign = || InputError::OtherSearch {
        path: path.to_path_buf(),
    };
    let text = input_file::read(path).map_err(|_| foreign())?;
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let keys = tuning.ranges.len();
    let mut trials = Vec::new();
    for row in reader.records() {
        let row = row.map_err(|_| foreign())?;
        let numbers: Vec<f64> = row
            .iter()
            .map(str::parse)
            .collect::<Result<_, _>>()
            .map_err(|_| foreign())?;
        let (values, [kept, error_mm, ripple_n, torque_change_nm, cost]) = numbers
            .split_at_checked(keys)
            .and_then(|(values, scores)| Some((values, <[f64; 5]>::try_from(scores).ok()?)))
            .ok_or_else(foreign)?;
        trials.push(Trial {
            values: values.to_vec(),
            score: Score {
                kept,
                error_mm,
                ripple_n,
                torque_change_nm,
            },
            cost,
        });
    }
    trials.truncate(all);
    // The last trial is computed again: the same search gives it again, to the last digit.
    let known = trials.len().saturating_sub(1);
    let batch = known - known % BATCH;
    if !trials.is_empty() {
        let again = tuning.next_trials(&trials[..batch], all, given)?;
        if again
            .iter()
            .zip(&trials[batch..])
            .any(|(one, other)| one != other)
        {
            return Err(foreign().into());
        }
        warn(format_args!(
            "continues {} after {} trials",
            path.display(),
            trials.len()
        ));
    }
    Ok(trials)
}

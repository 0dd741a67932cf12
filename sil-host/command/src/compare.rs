//! `painleve compare`: runs beside each other, in one page and one figure.

use std::io::BufReader;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use painleve_chart::picture;
use painleve_files::atomic_file::{commit_all, prepare};
use painleve_files::input_file;
use painleve_process::terminal;
use painleve_record::comparison::{Alignment, COLUMNS, Comparison, Difference, MOST_RUNS, Run};
use painleve_record::run_table::RunTable;
use painleve_view::comparison::comparison_html;
use serde_json::json;

use super::json::JsonOption;
use super::output_error::{InputError, output};
use super::{CommandError, distinct_files, given_scenario};

/// Options of `painleve compare`.
#[derive(Debug, Args)]
pub struct CompareArguments {
    /// Records (.mcap) or tables of ticks (.csv) of up to seven runs, simulated or of a board; the first is a record, and
    /// the others are compared with it.
    #[arg(num_args = 2..=MOST_RUNS, required = true)]
    runs: Vec<PathBuf>,
    /// What happens at the same time in all of them.
    #[arg(long, value_enum, default_value = "enable")]
    align: Align,
    /// Page that plays the first run with the others beside it.
    #[arg(long, value_name = "PATH", default_value = "out/compare.html")]
    html: PathBuf,
    /// Figure of all runs: an SVG, PNG or PDF file, by its extension.
    #[arg(long, value_name = "PATH", default_value = "out/compare.svg", value_parser = super::figure_path())]
    plot: PathBuf,
    #[command(flatten)]
    json: JsonOption,
}

/// An event of a run.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Align {
    /// The first tick.
    Start,
    /// The input ENABLE rises.
    Enable,
    /// The controller finds the tip on the belt for the first time.
    Contact,
}

impl From<Align> for Alignment {
    fn from(align: Align) -> Self {
        match align {
            Align::Start => Self::Start,
            Align::Enable => Self::Enable,
            Align::Contact => Self::Contact,
        }
    }
}

/// Writes page and figure, and prints the differences.
///
/// # Errors
/// [`CommandError`] if a run cannot be read or lacks the event, or an output cannot be written.
pub fn run(arguments: &CompareArguments) -> Result<(), CommandError> {
    let runs: Vec<Run> = arguments
        .runs
        .iter()
        .map(|path| read(path, &label(path, &arguments.runs)))
        .collect::<Result<_, _>>()?;
    let first = runs.first().and_then(|run| run.scenario.as_ref());
    let scenario = first.ok_or_else(|| InputError::FirstWithoutSettings {
        path: arguments.runs[0].clone(),
    })?;
    let comparison = Comparison::new(&runs, arguments.align.into()).map_err(InputError::NoEvent)?;
    let (html, plot) = (&arguments.html, &arguments.plot);
    distinct_files::check(&[("--html", html), ("--plot", plot)])?;
    let (outcomes, differences) = (comparison.outcomes(), comparison.differences());
    let page = comparison_html(&comparison, &outcomes, &differences, scenario);
    let figure = picture::encoded(plot, comparison.svg()).map_err(output)?;
    commit_all(vec![
        prepare(html, page.as_bytes()).map_err(output)?,
        prepare(plot, &figure).map_err(output)?,
    ])
    .map_err(output)?;
    let mut table = terminal::table(Difference::HEAD);
    for one in &differences {
        table.add_row(one.cells());
    }
    let result = json!({
        "html": html.display().to_string(),
        "plot": plot.display().to_string(),
        "outcomes": outcomes,
        "differences": differences,
    });
    let table = terminal::readable_table(table);
    let wrote = format!("wrote {} and {}", html.display(), plot.display());
    arguments
        .json
        .say(&result, format_args!("{table}\n{wrote}"))
}

/// Returns the name of a run: that of its file, or the whole path if another file has the same name.
fn label(path: &Path, all: &[PathBuf]) -> String {
    let is_unique = all
        .iter()
        .filter(|other| other.file_name() == path.file_name())
        .count()
        == 1;
    match path.file_name() {
        Some(name) if is_unique => name.to_string_lossy().into(),
        _ => path.display().to_string(),
    }
}

fn read(path: &Path, label: &str) -> Result<Run, CommandError> {
    let file = input_file::open(path).map_err(|error| InputError::record(path, error))?;
    let file = BufReader::with_capacity(1 << 20, file);
    let is_record = given_scenario::is_record(path);
    let table = if is_record {
        RunTable::of_record(file, &COLUMNS)
    } else {
        RunTable::of_csv(file, &COLUMNS)
    };
    Ok(Run {
        label: label.into(),
        table: table.map_err(|error| InputError::record(path, error))?,
        scenario: is_record
            .then(|| given_scenario::of_record(path))
            .transpose()?,
    })
}

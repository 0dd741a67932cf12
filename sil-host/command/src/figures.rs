//! `painleve figures`: all of the paper's studies, on one page with a comparison to the paper.

use std::path::{Path, PathBuf};
use std::sync::mpsc;

use clap::Args;
use painleve_files::atomic_file::{AtomicFile, commit_all, prepare};
use painleve_plant::closed_loop::{ClosedLoop, LoopResult, Monitor};
use painleve_plant::controller_host::InProcess;
use painleve_plant::scenario::{Scenario, ScenarioError};
use painleve_plant::simulation::Simulation;
use painleve_record::events::RunEvent;
use painleve_record::{RecordError, RecordedTick, Recorder, RunPlot, Sink};
use painleve_study::STUDIES;
use painleve_study_core::catalogue::AnyOutcome;
use painleve_study_core::figures::page_maker::{Fineness, PageMaker};
use painleve_study_core::figures::{self, Page, Section};
use serde_json::{Value, json};

use super::json::JsonOption;
use super::output::complete;
use super::output_error::output;
use super::progress::{Progress, Shown};
use super::study::outcome::Threads;
use super::{CommandError, distinct_files};

/// Options of `painleve figures`.
#[derive(Debug, Args)]
pub struct FiguresArguments {
    /// Folder for the page, the figures and their data.
    #[arg(long, value_name = "FOLDER", default_value = "out/figures")]
    out: PathBuf,
    /// Coarse grids and short runs, for a first look.
    #[arg(long)]
    draft: bool,
    #[command(flatten)]
    threads: Threads,
    #[command(flatten)]
    json: JsonOption,
}

/// The simulations shown in the paper.
const RUNS: [&str; 4] = [
    "pid-elbow-down",
    "pid-elbow-up",
    "hybrid-elbow-down",
    "hybrid-elbow-up",
];

/// Computes all studies, then writes the page.
///
/// # Errors
/// [`CommandError`] if a study fails, the page cannot be written, or the user interrupts.
pub fn run(arguments: &FiguresArguments) -> Result<(), CommandError> {
    let folder = &arguments.out;
    let page_path = folder.join("index.html");
    distinct_files::check(&[("--out", &page_path)])?;
    let page = PageMaker {
        fineness: if arguments.draft {
            &Fineness::DRAFT
        } else {
            &Fineness::FULL
        },
        progress: &|title, rows| {
            let progress = Progress::start(title, rows, Shown::with_json(arguments.json.json));
            Box::new(move || progress.row_done())
        },
    };
    // Written only when all files are ready, so that Ctrl-C cannot leave old figures beside new
    // ones.
    let mut files = Vec::new();
    let mut sections = Vec::new();
    for study in &STUDIES {
        for (section, outcome) in arguments.threads.in_pool(|| (study.sections)(&page))?? {
            files.extend(data(folder, &section, &*outcome)?);
            sections.push(section);
        }
    }
    for name in RUNS {
        let section = simulated(name)?;
        files.push((
            folder.join(format!("{}.svg", section.name)),
            section.svg.clone().into_bytes(),
        ));
        sections.push(section);
    }
    let page = Page {
        title: "The paper's results, recomputed".into(),
        introduction: format!(
            "Every figure and number of Marchese, Coraggio, Hogan and di Bernardo, Control of Painlevé \
             Paradox in a Robotic System (arXiv:1907.04070), beside what painleve {} finds.",
            env!("CARGO_PKG_VERSION")
        ),
        is_draft: arguments.draft,
        sections,
    };
    let html = page.html();
    let contents = files
        .iter()
        .map(|(path, contents)| (path, contents.as_slice()));
    let contents = contents.chain([(&page_path, html.as_bytes())]);
    let prepared: Result<_, _> = contents
        .map(|(path, contents)| prepare(path, contents))
        .collect();
    prepared.and_then(commit_all).map_err(output)?;
    arguments
        .json
        .say(&result(&page_path, &page, &files), page_path.display())
}

/// Returns what the command prints with `--json`.
fn result(page_path: &Path, page: &Page, files: &[(PathBuf, Vec<u8>)]) -> Value {
    let section = |section: &Section| {
        json!({
            "name": section.name,
            "title": section.title,
            "commands": section.commands,
            "comparisons": section.comparisons,
        })
    };
    json!({
        "page": page_path.display().to_string(),
        "draft": page.is_draft,
        "files": files.iter().map(|(path, _)| path.display().to_string()).collect::<Vec<_>>(),
        "sections": page.sections.iter().map(section).collect::<Vec<_>>(),
    })
}

/// Returns the data files of a section's outcome, to be written beside the page.
fn data(
    folder: &Path,
    section: &Section,
    outcome: &dyn AnyOutcome,
) -> Result<[(PathBuf, Vec<u8>); 3], CommandError> {
    let path = |ending: &str| folder.join(format!("{}.{ending}", section.name));
    Ok([
        (path("svg"), section.svg.clone().into_bytes()),
        (path("csv"), outcome.csv().map_err(output)?),
        (path("json"), outcome.json().map_err(output)?.into_bytes()),
    ])
}

/// Runs a scenario and draws it.
fn simulated(name: &str) -> Result<Section, CommandError> {
    let scenario = Scenario::load(name, &[])?;
    let (svg, drawn) = mpsc::channel();
    let drawing = Drawing {
        plot: RunPlot::new(&scenario),
        svg,
    };
    let configuration = scenario.controller_configuration();
    let recorder = Recorder::start(&configuration, vec![Box::new(drawing)]);
    let mut recorder = recorder.map_err(output)?;
    let result = simulate(&scenario, &mut recorder)?;
    complete(recorder).1?;
    let svg = drawn.recv().unwrap_or_default();
    Ok(figures::run::section(&scenario, &result, svg))
}

/// Draws a run, and sends the figure when it is complete.
struct Drawing {
    plot: RunPlot,
    svg: mpsc::Sender<String>,
}

impl Sink for Drawing {
    fn tick(&mut self, tick: &RecordedTick<'_>) -> Result<(), RecordError> {
        self.plot.tick(tick);
        Ok(())
    }

    fn event(&mut self, event: &RunEvent) -> Result<(), RecordError> {
        self.plot.event(event);
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<Option<AtomicFile>, RecordError> {
        // Its receiver waits for it.
        let _ = self.svg.send(self.plot.svg());
        Ok(None)
    }
}

/// Runs a scenario in this process.
fn simulate(scenario: &Scenario, monitor: &mut impl Monitor) -> Result<LoopResult, CommandError> {
    let range = |source| ScenarioError::range(&scenario.name, source);
    let simulation = Simulation::new(scenario).map_err(range)?;
    let host = InProcess::new(&scenario.controller_configuration()).map_err(range)?;
    let mut running = ClosedLoop::new(simulation, host);
    for _ in 0..scenario.run.ticks() {
        running.tick(monitor)?;
    }
    Ok(running.finish().0)
}

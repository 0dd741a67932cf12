//! The output files of a run, written while it runs.

use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::TypedValueParser as _;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use painleve_files::atomic_file::AtomicFile;
use painleve_plant::Event;
use painleve_plant::closed_loop::{LoopError, Monitor};
use painleve_plant::sample::Sample;
use painleve_plant::scenario::Scenario;
use painleve_process::interrupt::Interrupt;
use painleve_process::terminal::warn;
use painleve_record::csv_table::CsvTable;
use painleve_record::events::RunEvent;
use painleve_record::mcap_log::Source;
use painleve_record::plot::PlotFile;
use painleve_record::recorder::Sinks;
use painleve_record::{McapLog, RecordError, RecordedTick, Recorder, RunPlot, Sink};
use painleve_view::PageFile;
use serde::{Deserialize, Serialize};

use super::distinct_files::{self, check_distinct};
use super::output_error::output;
use super::system_path::SystemPath;
use super::{CommandError, UNWRITABLE};

/// The files that a run writes.
#[derive(Clone, Debug, Args, Serialize, Deserialize)]
pub struct OutputArguments {
    /// Record of every tick, for Foxglove and PlotJuggler.
    #[arg(long, value_name = "PATH", default_value = "out/run.mcap")]
    record: SystemPath,
    /// Do not write a record.
    #[arg(long, conflicts_with = "record")]
    no_record: bool,
    /// Figure of the run: an SVG, PNG or PDF file, by its extension.
    #[arg(long, value_name = "PATH", default_value = "out/run.svg", value_parser = super::figure_path().map(|path| SystemPath::from(path.into_os_string())))]
    plot: SystemPath,
    /// Page that plays the run in the browser, without a network.
    #[arg(long, value_name = "PATH", default_value = "out/run.html")]
    html: SystemPath,
    /// Do not write a page.
    #[arg(long, conflicts_with = "html")]
    no_html: bool,
    /// Write neither figure nor page.
    #[arg(long, conflicts_with_all = ["plot", "html"])]
    no_plot: bool,
    /// Table of every tick, a CSV file.
    #[arg(long, value_name = "PATH")]
    csv: Option<SystemPath>,
    /// Print the events of the run on standard error: changes of mode and state, lift-offs, impacts,
    /// faults.
    #[arg(short, long)]
    verbose: bool,
}

impl OutputArguments {
    /// Returns the files to write, each with its option.
    pub fn files(&self) -> Vec<distinct_files::Output<'_>> {
        let wanted: [(_, Option<&SystemPath>); 4] = [
            ("--record", (!self.no_record).then_some(&self.record)),
            ("--plot", (!self.no_plot).then_some(&self.plot)),
            (
                "--html",
                (!self.no_html && !self.no_plot).then_some(&self.html),
            ),
            ("--csv", self.csv.as_ref()),
        ];
        wanted
            .into_iter()
            .filter_map(|(option, path)| Some((option, &**path?)))
            .collect()
    }

    /// Creates the files.
    fn sinks(&self, scenario: &Scenario) -> Result<Sinks, CommandError> {
        check_distinct(&self.files())?;
        let mut sinks: Sinks = Vec::new();
        for (option, path) in self.files() {
            let file = AtomicFile::create(path).map_err(output)?;
            file.check_alone().map_err(output)?;
            sinks.push(match option {
                "--record" => {
                    Box::new(McapLog::to(file, scenario, Source::Simulation).map_err(output)?)
                }
                "--csv" => Box::new(CsvTable::to(file).map_err(output)?),
                "--html" => Box::new(PageFile::new(file, scenario)),
                _ => Box::new(PlotFile {
                    plot: RunPlot::new(scenario),
                    file,
                }),
            });
        }
        if self.verbose {
            sinks.push(Box::new(EventPrinter));
        }
        Ok(sinks)
    }
}

/// Prints the events of a run.
struct EventPrinter;

impl Sink for EventPrinter {
    fn tick(&mut self, _tick: &RecordedTick<'_>) -> Result<(), RecordError> {
        Ok(())
    }

    fn event(&mut self, event: &RunEvent) -> Result<(), RecordError> {
        warn(format_args!(
            "{:9.4} s  {}",
            event.time_s,
            event.kind.describe()
        ));
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<Option<AtomicFile>, RecordError> {
        Ok(None)
    }
}

/// Ticks between two updates of the progress bar.
const PROGRESS_TICKS: u64 = 256;

/// The files of a run and its progress bar.
pub struct Output {
    /// `None` if the run writes no file.
    recorder: Option<Recorder>,
    /// Whether a file could not be written, which has been reported.
    has_failed: bool,
    progress: ProgressBar,
    interrupt: Interrupt,
    tick: u64,
}

impl Output {
    /// Creates the files, so that an unwritable path is reported before anything runs.
    ///
    /// # Errors
    /// [`CommandError::Output`], or [`CommandError::Input`] if two names mean one file.
    pub fn open(
        arguments: &OutputArguments,
        scenario: &Scenario,
        interrupt: Interrupt,
    ) -> Result<Self, CommandError> {
        let sinks = arguments.sinks(scenario)?;
        let recorder = if sinks.is_empty() {
            None
        } else {
            let configuration = scenario.controller_configuration();
            Some(Recorder::start(&configuration, sinks).map_err(output)?)
        };
        Ok(Self {
            recorder,
            has_failed: false,
            progress: progress_bar(scenario.run.ticks()),
            interrupt,
            tick: 0,
        })
    }

    /// Keeps the partial record, if the run has begun.
    pub fn keep_partial(self, reason: &str) {
        self.progress.finish_and_clear();
        if self.tick == 0 {
            return;
        }
        if let Some(recorder) = self.recorder {
            keep_partial(recorder, reason);
        }
    }

    /// Completes the files; without this nothing appears under their names. Returns the paths of those that are complete,
    /// and an error if another is not, which has been reported.
    pub fn finish(self) -> (Vec<String>, Result<(), CommandError>) {
        self.progress.finish_and_clear();
        let (paths, completed) = self.recorder.map_or((Vec::new(), Ok(())), complete);
        (paths, completed.and(told(self.has_failed)))
    }
}

/// Completes the files of a recording. Returns the paths of those that are complete, and an error if another is not, which
/// has been reported.
pub fn complete(recorder: Recorder) -> (Vec<String>, Result<(), CommandError>) {
    let recorded = recorder.finish();
    warn_of_failures(&recorded.failures);
    let paths = recorded.complete.iter();
    (
        paths.map(|path| path.display().to_string()).collect(),
        told(!recorded.failures.is_empty()),
    )
}

/// Returns the error of files that could not be written, which has been reported, if there are any.
fn told(has_failed: bool) -> Result<(), CommandError> {
    match has_failed {
        true => Err(CommandError::Told { code: UNWRITABLE }),
        false => Ok(()),
    }
}

/// Returns where what has been measured of an arm is written by default: that of a rehearsal apart from that of a real arm.
pub fn default_output(rehearses: bool, name: &str) -> PathBuf {
    let folder = if rehearses { "out/rehearsed" } else { "out" };
    format!("{folder}/{name}.toml").into()
}

/// Tells, after a failure, which results of an earlier run are still there.
pub fn warn_of_earlier(paths: &[&Path]) {
    for path in paths.iter().filter(|path| path.exists()) {
        warn(format_args!(
            "{} is still that of an earlier run",
            path.display()
        ));
    }
}

/// Keeps the partial records of a run that ended early, and reports their paths.
pub fn keep_partial(recorder: Recorder, reason: &str) {
    let recorded = recorder.finish_partial(reason);
    for path in recorded.partial {
        warn(format_args!("the partial record is in {}", path.display()));
    }
    warn_of_failures(&recorded.failures);
}

fn warn_of_failures(failures: &[RecordError]) {
    for failure in failures {
        warn(format_args!("error: {failure}"));
    }
}

/// A bar on stderr, where it is a terminal; nothing elsewhere.
fn progress_bar(ticks: u64) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(ticks), ProgressDrawTarget::stderr());
    let template = "{bar:40} {percent:>3} %  {pos}/{len} ticks  {eta} left";
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    bar
}

impl Monitor for Output {
    fn wants_samples(&self) -> bool {
        self.recorder.is_some()
    }

    fn sample(&mut self, sample: &Sample) -> Result<(), LoopError> {
        match self.recorder.as_mut().map(|recorder| recorder.push(sample)) {
            Some(Err(error @ RecordError::Ended)) => Err(LoopError::Monitor(Box::new(error))),
            Some(Err(failure)) => {
                // The run goes on, and its report and the other files are complete.
                warn_of_failures(&[failure]);
                self.has_failed = true;
                Ok(())
            }
            Some(Ok(())) | None => Ok(()),
        }
    }

    fn event(&mut self, time_s: f64, event: Event) {
        if let Some(recorder) = &mut self.recorder {
            recorder.push_event(time_s, event);
        }
    }

    fn tick(&mut self) -> Result<(), LoopError> {
        self.tick += 1;
        if self.tick.is_multiple_of(PROGRESS_TICKS) {
            self.progress.set_position(self.tick);
        }
        if self.interrupt.is_requested() {
            return Err(LoopError::Interrupted);
        }
        Ok(())
    }
}

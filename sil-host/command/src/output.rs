//! The output files of a run, written while it runs.

use std::collections::BTreeMap;
use std::path::PathBuf;

use clap::Args;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use painleve_plant::closed_loop::{LoopError, Monitor};
use painleve_plant::sample::Sample;
use painleve_plant::scenario::Scenario;
use painleve_record::RunPlot;
use painleve_record::mcap::Recorder;
use painleve_system::atomic_file::AtomicFile;
use painleve_system::interrupt::Interrupt;
use painleve_system::terminal::warn;

use super::CommandError;

/// The files that a run writes.
#[derive(Clone, Debug, Args)]
pub struct OutputArguments {
    /// Record of every tick, for Foxglove and PlotJuggler.
    #[arg(long, value_name = "PATH", default_value = "out/run.mcap")]
    record: PathBuf,
    /// Do not write a record.
    #[arg(long, conflicts_with = "record")]
    no_record: bool,
    /// Figure of the run.
    #[arg(long, value_name = "PATH", default_value = "out/run.svg")]
    plot: PathBuf,
    /// Do not write a figure.
    #[arg(long, conflicts_with = "plot")]
    no_plot: bool,
}

impl OutputArguments {
    /// Returns the same options as command-line arguments for a child process.
    pub fn to_arguments(&self) -> Vec<std::ffi::OsString> {
        let mut arguments = Vec::new();
        if self.no_record {
            arguments.push("--no-record".into());
        } else {
            arguments.extend(["--record".into(), self.record.clone().into()]);
        }
        if self.no_plot {
            arguments.push("--no-plot".into());
        } else {
            arguments.extend(["--plot".into(), self.plot.clone().into()]);
        }
        arguments
    }
}

/// Ticks between two updates of the progress bar.
const PROGRESS_TICKS: u64 = 256;

/// Record, figure and progress bar of a run.
pub struct Output {
    recorder: Option<Recorder>,
    plot: Option<(RunPlot, PathBuf)>,
    progress: ProgressBar,
    interrupt: Interrupt,
    tick: u64,
}

impl Output {
    /// Opens the files, so that an unwritable path is reported before anything runs.
    pub fn open(
        arguments: &OutputArguments,
        scenario: &Scenario,
        interrupt: Interrupt,
    ) -> Result<Self, CommandError> {
        let output = |error: &dyn std::fmt::Display| CommandError::Output(error.to_string());
        let recorder = if arguments.no_record {
            None
        } else {
            let text = toml::to_string(scenario).map_err(|error| output(&error))?;
            let metadata = BTreeMap::from([
                ("scenario".into(), scenario.name.clone()),
                ("configuration".into(), text),
                ("version".into(), env!("CARGO_PKG_VERSION").into()),
            ]);
            Some(Recorder::create(&arguments.record, &metadata).map_err(|error| output(&error))?)
        };
        let plot = if arguments.no_plot {
            None
        } else {
            let plot = AtomicFile::create(&arguments.plot).map_err(|error| output(&error))?;
            if recorder
                .as_ref()
                .is_some_and(|recorder| recorder.is_same_file(&plot))
            {
                return Err(CommandError::SameFile(arguments.plot.clone()));
            }
            let subtitle = format!(
                "law: {} · {} Hz · μ = {} · seed {}",
                scenario.controller.law.name(),
                scenario.run.tick_hz,
                scenario.belt.friction,
                scenario.run.seed,
            );
            Some((
                RunPlot::new(&scenario.name, &subtitle),
                arguments.plot.clone(),
            ))
        };
        Ok(Self {
            recorder,
            plot,
            progress: progress_bar(scenario.run.ticks()),
            interrupt,
            tick: 0,
        })
    }

    /// Keeps the partial record of a run that ended early, and reports its path.
    pub fn keep_partial(self, reason: &str) {
        self.progress.finish_and_clear();
        if self.tick == 0 {
            return;
        }
        match self
            .recorder
            .map(|recorder| recorder.finish_partial(reason))
        {
            None => {}
            Some(Ok(path)) => warn(format_args!("the partial record is in {}", path.display())),
            Some(Err(error)) => warn(format_args!(
                "the partial record could not be kept: {error}"
            )),
        }
    }

    /// Completes the files; they have no final name before that.
    pub fn finish(self) -> Result<(), CommandError> {
        self.progress.finish_and_clear();
        if let Some(recorder) = self.recorder {
            recorder
                .finish()
                .map_err(|error| CommandError::Output(error.to_string()))?;
        }
        if let Some((plot, path)) = self.plot {
            plot.write(path)
                .map_err(|error| CommandError::Output(error.to_string()))?;
        }
        Ok(())
    }
}

/// Returns a progress bar on stderr if it is a terminal, otherwise a hidden one.
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
        self.recorder.is_some() || self.plot.is_some()
    }

    fn sample(&mut self, sample: &Sample) -> Result<(), LoopError> {
        if let Some(recorder) = &mut self.recorder {
            recorder
                .push(sample)
                .map_err(|error| LoopError::Monitor(Box::new(error)))?;
        }
        if let Some((plot, _)) = &mut self.plot {
            plot.push(sample);
        }
        Ok(())
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

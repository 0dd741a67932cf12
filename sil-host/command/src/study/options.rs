//! Options that all studies share: what to vary from, where the outcome goes.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use painleve_plant::scenario::Scenario;
use painleve_shared::Posture;
use painleve_study::{Outcome, Study, StudyError, outcome};
use painleve_system::atomic_file::{self, AtomicFile};

use crate::{CommandError, say};

/// The built-in scenario without a controller.
const OPEN_LOOP: &str = "open-loop-bounce";

/// The scenario that an open-loop study varies.
#[derive(Clone, Debug, Args)]
pub struct BaseOptions {
    /// Built-in scenario or TOML file whose plant and controller are studied.
    #[arg(long, value_name = "SCENARIO", default_value = OPEN_LOOP)]
    scenario: String,
    #[command(flatten)]
    overrides: Overrides,
}

impl BaseOptions {
    /// Name of the scenario.
    pub fn name(&self) -> &str {
        &self.scenario
    }

    /// The scenario, its numbers checked but not where the arm starts. `taken` are keys
    /// that the study's own options set, with the option of each.
    ///
    /// # Errors
    /// [`StudyError`] if it is wrong, or sets a key that is taken.
    pub fn load(&self, taken: &[(&str, &str)]) -> Result<Scenario, StudyError> {
        self.overrides.refuse(taken)?;
        Ok(Scenario::load_unplaced(
            &self.scenario,
            &self.overrides.overrides,
        )?)
    }
}

/// Changes to every scenario of a study.
#[derive(Clone, Debug, Args)]
pub struct Overrides {
    /// Override one key of plant or controller, as in arm.height_m=0.36; may be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub overrides: Vec<String>,
}

impl Overrides {
    /// Refuses overrides of keys that the study's own options set.
    ///
    /// # Errors
    /// [`StudyError::Option`] naming the option to use.
    pub fn refuse(&self, taken: &[(&str, &str)]) -> Result<(), StudyError> {
        for text in &self.overrides {
            let key = text.split('=').next().unwrap_or_default().trim();
            let inside = |taken: &str| {
                key == taken
                    || key
                        .strip_prefix(taken)
                        .is_some_and(|rest| rest.starts_with('.'))
            };
            if let Some((_, option)) = taken.iter().find(|(taken, _)| inside(taken)) {
                return Err(StudyError::Option(format!(
                    "--set {key} has no effect here; use {option}"
                )));
            }
        }
        Ok(())
    }
}

/// Where the outcome of a study goes, and how many threads compute it.
#[derive(Clone, Debug, Args)]
pub struct OutcomeOptions {
    /// Print one JSON object on stdout instead of the table.
    #[arg(long)]
    json: bool,
    /// Write the rows as a CSV file.
    #[arg(long, value_name = "PATH")]
    csv: Option<PathBuf>,
    /// Write the figure.
    #[arg(long, value_name = "PATH")]
    svg: Option<PathBuf>,
    #[command(flatten)]
    pub threads: Threads,
}

/// How many threads compute.
#[derive(Clone, Debug, Args)]
pub struct Threads {
    /// Threads that compute; all cores by default. The outcome does not depend on it.
    #[arg(long, value_name = "N")]
    threads: Option<NonZeroUsize>,
}

impl Threads {
    /// Computes a study with a progress bar.
    ///
    /// # Errors
    /// [`CommandError`] if the study has no outcome.
    pub fn compute<S: Study>(&self, name: &str, study: &S) -> Result<Vec<S::Row>, CommandError> {
        let bar = progress_bar(name, study.len());
        let rows = self.in_pool(|| painleve_study::rows(study, || bar.inc(1)))?;
        bar.finish_and_clear();
        Ok(rows?)
    }

    /// Runs something on the threads that were asked for.
    ///
    /// # Errors
    /// [`CommandError::Process`] if they cannot be started.
    pub fn in_pool<T: Send>(&self, work: impl FnOnce() -> T + Send) -> Result<T, CommandError> {
        let threads = self.threads.map_or(0, NonZeroUsize::get);
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .map_err(|error| CommandError::Process(format!("cannot start threads: {error}")))?;
        Ok(pool.install(work))
    }
}

impl OutcomeOptions {
    /// Computes a study with a progress bar.
    ///
    /// # Errors
    /// [`CommandError`] if an output cannot be written, which is found out first, or the
    /// study has no outcome.
    pub fn compute<S: Study>(&self, study: &S) -> Result<Vec<S::Row>, CommandError> {
        self.check()?;
        self.threads.compute("", study)
    }

    /// Finds out whether the files can be written.
    ///
    /// # Errors
    /// [`CommandError::Output`] naming the first that cannot.
    pub fn check(&self) -> Result<(), CommandError> {
        for path in [&self.csv, &self.svg].into_iter().flatten() {
            AtomicFile::create(path).map_err(output)?;
        }
        Ok(())
    }

    /// Writes the files, then prints the outcome.
    ///
    /// # Errors
    /// [`CommandError::Output`] if something cannot be written.
    pub fn write(&self, outcome: &impl Outcome) -> Result<(), CommandError> {
        if let Some(path) = &self.csv {
            let text = outcome::csv(outcome).map_err(output)?;
            atomic_file::write(path, &text).map_err(output)?;
        }
        if let Some(path) = &self.svg {
            let text = outcome.svg().map_err(output)?;
            atomic_file::write(path, text.as_bytes()).map_err(output)?;
        }
        let text = if self.json {
            serde_json::to_string(outcome).map_err(output)?
        } else {
            outcome.table().to_string()
        };
        say(text)
    }
}

/// An output that cannot be written.
pub fn output(error: impl std::fmt::Display) -> CommandError {
    CommandError::Output(error.to_string())
}

/// A bar on stderr, where it is a terminal; nothing elsewhere.
fn progress_bar(name: &str, rows: usize) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(rows as u64), ProgressDrawTarget::stderr());
    let template = "{prefix}{bar:40} {percent:>3} %  {pos}/{len} rows  {eta} left";
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    if !name.is_empty() {
        bar.set_prefix(format!("{name}  "));
    }
    bar.enable_steady_tick(std::time::Duration::from_millis(200));
    bar
}

/// A posture on the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum PostureOption {
    /// θ2 > θ1.
    ElbowUp,
    /// θ2 < θ1.
    ElbowDown,
}

impl From<PostureOption> for Posture {
    fn from(option: PostureOption) -> Self {
        match option {
            PostureOption::ElbowUp => Self::ElbowUp,
            PostureOption::ElbowDown => Self::ElbowDown,
        }
    }
}

/// A length on the command line.
pub fn metres(text: &str) -> Result<f64, String> {
    positive(text, 1e-6, 1.0, "metres")
}

/// A duration on the command line.
pub fn seconds(text: &str) -> Result<f64, String> {
    positive(text, 1e-3, 1e6, "seconds")
}

/// A number of runs on the command line.
pub fn runs(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(runs @ 1..=10_000_000) => Ok(runs),
        _ => Err("give a number of runs from 1 to 10000000".into()),
    }
}

fn positive(text: &str, least: f64, most: f64, unit: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (least..=most).contains(&value) => Ok(value),
        _ => Err(format!("give {unit} from {least} to {most}")),
    }
}

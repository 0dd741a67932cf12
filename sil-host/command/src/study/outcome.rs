//! Output files of a study, and the number of threads that compute it.

use painleve_process::terminal;
use std::path::PathBuf;

use clap::Args;
use comfy_table::ContentArrangement;
use comfy_table::presets::ASCII_MARKDOWN;
use painleve_chart::picture;
use painleve_files::atomic_file::{commit_all, prepare};
use painleve_study_core::Study;
use painleve_study_core::catalogue::{AnyOutcome, AnyStudy};
use painleve_study_core::options::number;

use crate::output_error::output;
use crate::process_error::ProcessError;
use crate::progress::{Progress, Shown};
use crate::{CommandError, distinct_files, say};

/// Output files of a study, and the number of threads that compute it.
#[derive(Clone, Debug, Args)]
pub struct OutcomeOptions {
    /// Print one JSON object on stdout instead of the table.
    #[arg(long)]
    json: bool,
    /// Print the table as Markdown.
    #[arg(long, conflicts_with = "json")]
    markdown: bool,
    /// Write the rows as a CSV file.
    #[arg(long, value_name = "PATH")]
    csv: Option<PathBuf>,
    /// Write the figure, an SVG, PNG or PDF file by its extension.
    #[arg(long, value_name = "PATH", value_parser = crate::figure_path())]
    svg: Option<PathBuf>,
    #[command(flatten)]
    threads: Threads,
}

/// Number of threads.
#[derive(Clone, Debug, Args)]
pub struct Threads {
    /// Number of threads; all cores by default. The result does not depend on it.
    #[arg(long, value_name = "N", value_parser = |text: &str| number(text, 1_u16..=1024, "a whole number"))]
    threads: Option<u16>,
}

impl Threads {
    /// Computes the rows of a study and shows the progress.
    ///
    /// # Errors
    /// [`CommandError`] if a row cannot be computed.
    pub fn compute<S: Study>(
        &self,
        name: &str,
        study: &S,
        shown: Shown,
    ) -> Result<Vec<S::Row>, CommandError> {
        let progress = Progress::start(name, study.len(), shown);
        Ok(self.in_pool(|| painleve_study_core::rows(study, || progress.row_done()))??)
    }

    /// Runs `work` on the requested number of threads.
    ///
    /// # Errors
    /// [`CommandError::Process`] if the threads cannot be started.
    pub fn in_pool<T: Send>(&self, work: impl FnOnce() -> T + Send) -> Result<T, CommandError> {
        let threads = self.threads.map_or(0, usize::from);
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .map_err(ProcessError::Threads)?;
        Ok(pool.install(work))
    }
}

impl OutcomeOptions {
    /// Computes a study and shows the progress, writes the files and prints the result.
    ///
    /// # Errors
    /// [`CommandError`] if an output cannot be written, which is checked first, or if the study
    /// fails.
    pub fn make(&self, study: &dyn AnyStudy) -> Result<(), CommandError> {
        self.check()?;
        let progress = Progress::start("", study.row_count(), Shown::with_json(self.json));
        let outcome = self
            .threads
            .in_pool(|| study.compute(&|| progress.row_done()))??;
        drop(progress);
        self.write(&*outcome)
    }

    /// Checks that the files can be written and replace nothing that is read.
    fn check(&self) -> Result<(), CommandError> {
        let files = [
            ("--csv", self.csv.as_deref()),
            ("--svg", self.svg.as_deref()),
        ];
        let files = files
            .into_iter()
            .filter_map(|(option, path)| Some((option, path?)));
        distinct_files::check(&files.collect::<Vec<_>>())
    }

    fn write(&self, outcome: &dyn AnyOutcome) -> Result<(), CommandError> {
        let mut contents = Vec::new();
        if let Some(path) = &self.csv {
            contents.push((path, outcome.csv().map_err(output)?));
        }
        if let Some(path) = &self.svg {
            let picture = picture::encoded(path, outcome.svg()).map_err(output)?;
            contents.push((path, picture));
        }
        // Only now: whoever interrupts the converter of the figure finds no temporary file.
        let files = contents
            .into_iter()
            .map(|(path, content)| prepare(path, &content));
        let files = files.collect::<Result<_, _>>().map_err(output)?;
        commit_all(files).map_err(output)?;
        if self.json {
            say(outcome.json().map_err(output)?)
        } else if self.markdown {
            let mut table = outcome.table();
            table
                .load_style(ASCII_MARKDOWN)
                .set_content_arrangement(ContentArrangement::Disabled);
            say(terminal::readable_table(table))
        } else {
            say(terminal::readable_table(outcome.table()))
        }
    }
}

//! What command line, sweeps and the page of figures need of a study, whatever its type.

use clap::{ArgMatches, Args, Command};
use comfy_table::Table;

use crate::figures::Section;
use crate::figures::page_maker::PageMaker;
use crate::outcome::{self, Figure, Outcome};
use crate::tabular::{self, Tabular};
use crate::{Study, StudyError, rows};

/// A study as its options define it. The doc comment of the type is its line in the command's help.
pub trait StudyOptions: Args + Sync + 'static {
    /// The study's name on the command line.
    const NAME: &'static str;
    /// [`in_shards`] if a sweep can compute the study in shards.
    const IN_SHARDS: Option<InShards<Self::Study>> = None;
    /// The study.
    type Study: Study + 'static;
    /// The outcome of its rows.
    type Outcome: Outcome + Figure + Send + 'static;

    /// Returns the requested study, checked.
    ///
    /// # Errors
    /// [`StudyError`] naming the option or key that is wrong.
    fn study(&self) -> Result<Self::Study, StudyError>;

    /// Collects all rows of a study into its outcome.
    fn outcome(study: &Self::Study, rows: Vec<<Self::Study as Study>::Row>) -> Self::Outcome;

    /// Returns the study's sections of the page of figures; none by default.
    ///
    /// # Errors
    /// [`StudyError`] if a section cannot be computed.
    fn sections(_page: &PageMaker<'_>) -> Result<Vec<PageSection>, StudyError> {
        Ok(Vec::new())
    }
}

/// A section of the page of figures, and the outcome that it shows.
pub type PageSection = (Section, Box<dyn AnyOutcome>);

/// Turns a study into a table that a sweep computes in shards.
pub type InShards<S> = fn(S) -> Box<dyn tabular::Table>;

/// The [`InShards`] of a study whose rows are lines of a table.
pub fn in_shards<S: Tabular + 'static>(study: S) -> Box<dyn tabular::Table> {
    Box::new(study)
}

/// An entry of the list of studies.
pub struct CatalogueEntry {
    /// Its name on the command line.
    pub name: &'static str,
    /// Adds the study's options and its help line to a command.
    pub augment: fn(Command) -> Command,
    /// Whether a sweep can compute the study in shards.
    pub has_shards: bool,
    /// Parses its options.
    ///
    /// # Errors
    /// The error of clap.
    pub read: fn(&ArgMatches) -> Result<Box<dyn AnyOptions>, clap::Error>,
    /// Returns its sections of the page of figures.
    ///
    /// # Errors
    /// [`StudyError`] if a section cannot be computed.
    pub sections: fn(&PageMaker<'_>) -> Result<Vec<PageSection>, StudyError>,
}

impl CatalogueEntry {
    /// Makes the entry of a study.
    pub const fn of<O: StudyOptions>() -> Self {
        Self {
            name: O::NAME,
            augment: O::augment_args,
            has_shards: O::IN_SHARDS.is_some(),
            read: |matches| Ok(Box::new(O::from_arg_matches(matches)?)),
            sections: O::sections,
        }
    }

    /// Returns the study as a subcommand.
    pub fn command(&self) -> Command {
        (self.augment)(Command::new(self.name))
    }

    /// Returns the subcommand with further options after the study's own.
    pub fn augment_with<A: Args>(&self) -> Command {
        // The help line is set last; the help of the options would replace it.
        let about = self.command().get_about().cloned();
        let command = A::augment_args(self.command());
        about.map_or(command.clone(), |about| command.about(about))
    }
}

/// Options of any study.
pub trait AnyOptions {
    /// Returns the requested study, checked.
    ///
    /// # Errors
    /// [`StudyError`] naming the option or key that is wrong.
    fn study(&self) -> Result<Box<dyn AnyStudy>, StudyError>;

    /// Returns the study as a table, if its rows can be computed separately.
    ///
    /// # Errors
    /// [`StudyError`] naming the option or key that is wrong.
    fn table(&self) -> Result<Option<Box<dyn tabular::Table>>, StudyError>;
}

impl<O: StudyOptions> AnyOptions for O {
    fn study(&self) -> Result<Box<dyn AnyStudy>, StudyError> {
        let study = StudyOptions::study(self)?;
        Ok(Box::new(Asked::<O>(study)))
    }

    fn table(&self) -> Result<Option<Box<dyn tabular::Table>>, StudyError> {
        let study = StudyOptions::study(self)?;
        Ok(O::IN_SHARDS.map(|in_shards| in_shards(study)))
    }
}

/// Called after every row. A panic in it ends the study.
pub type Progress<'a> = &'a (dyn Fn() + Sync);

/// Any study.
pub trait AnyStudy: Sync {
    /// Returns the number of rows.
    fn row_count(&self) -> usize;

    /// Computes the study on the threads of the current rayon pool.
    ///
    /// # Errors
    /// The error of the first row that fails.
    fn compute(&self, progress: Progress<'_>) -> Result<Box<dyn AnyOutcome>, StudyError>;
}

struct Asked<O: StudyOptions>(O::Study);

impl<O: StudyOptions> AnyStudy for Asked<O> {
    fn row_count(&self) -> usize {
        self.0.len()
    }

    fn compute(&self, progress: Progress<'_>) -> Result<Box<dyn AnyOutcome>, StudyError> {
        let rows = rows(&self.0, progress)?;
        Ok(Box::new(O::outcome(&self.0, rows)))
    }
}

/// Any outcome.
pub trait AnyOutcome: Send {
    /// Returns the JSON object.
    ///
    /// # Errors
    /// If serialisation to JSON fails, which plain structs do not.
    fn json(&self) -> Result<String, serde_json::Error>;

    /// Returns the CSV file.
    ///
    /// # Errors
    /// If serialisation to CSV fails, which flat structs do not.
    fn csv(&self) -> Result<Vec<u8>, csv::Error>;

    /// Returns the table.
    fn table(&self) -> Table;

    /// Returns the figure as SVG text.
    fn svg(&self) -> String;
}

impl<T: Outcome + Figure + Send> AnyOutcome for T {
    fn json(&self) -> Result<String, serde_json::Error> {
        serde_json::to_string(self)
    }

    fn csv(&self) -> Result<Vec<u8>, csv::Error> {
        outcome::csv(self)
    }

    fn table(&self) -> Table {
        Outcome::table(self)
    }

    fn svg(&self) -> String {
        Figure::svg(self)
    }
}

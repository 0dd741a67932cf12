//! The list of studies. The command line, sweeps and the page of figures know them from here.

use std::sync::LazyLock;

use clap::{ArgMatches, Args, Command};
use comfy_table::Table;

use crate::figures::Section;
use crate::figures::page_maker::PageMaker;
use crate::outcome::{self, Figure, Outcome};
use crate::tabular::{self, Tabular};
use crate::{
    Study, StudyError, ablation, admissible, bifurcation, capture, closed_loop_bifurcation,
    lift_off, poincare, regions, robustness, rows, sliding_range,
};

/// Every study, in the order of the command's help and of the page.
pub static STUDIES: LazyLock<Vec<Entry>> = LazyLock::new(|| {
    vec![
        Entry::of::<admissible::Options>(),
        Entry::of::<regions::Options>(),
        Entry::of::<bifurcation::Options>(),
        Entry::of::<poincare::Options>(),
        Entry::of::<sliding_range::Options>(),
        Entry::of::<closed_loop_bifurcation::Options>(),
        Entry::of::<robustness::Options>(),
        Entry::of::<ablation::Options>(),
        Entry::of::<capture::Options>(),
        Entry::of::<lift_off::Options>(),
    ]
});

/// A study as its options describe it. Its doc comment is its line in the command's help.
pub trait StudyOptions: Args + Sync + 'static {
    /// The study's name on the command line.
    const NAME: &'static str;
    /// What is computed.
    type Study: Study + 'static;
    /// What its rows come to.
    type Outcome: Outcome + Figure + Send + 'static;

    /// The study that is asked for, checked.
    ///
    /// # Errors
    /// [`StudyError`] naming the option or key that is wrong.
    fn study(&self) -> Result<Self::Study, StudyError>;

    /// Puts all rows of a study together.
    fn outcome(study: &Self::Study, rows: Vec<<Self::Study as Study>::Row>) -> Self::Outcome;

    /// Whether a sweep can compute it in shards: [`table`](Self::table) gives one.
    const HAS_SHARDS: bool = false;

    /// The study as a table that a sweep computes in shards; none by default.
    fn table(_study: Self::Study) -> Option<Box<dyn tabular::Table>> {
        None
    }

    /// Names of the scenarios that the study starts from.
    fn scenarios(&self) -> Vec<String> {
        Vec::new()
    }

    /// The study's sections of the page of figures; none by default.
    ///
    /// # Errors
    /// [`StudyError`] if one cannot be computed.
    fn sections(_page: &PageMaker<'_>) -> Result<Vec<PageSection>, StudyError> {
        Ok(Vec::new())
    }
}

/// A section of the page of figures, and the outcome that it shows.
pub type PageSection = (Section, Box<dyn AnyOutcome>);

/// For [`StudyOptions::table`] of a study whose rows are lines of a table.
pub fn in_shards<S: Tabular + 'static>(study: S) -> Option<Box<dyn tabular::Table>> {
    Some(Box::new(study))
}

/// A study of the list.
pub struct Entry {
    /// Its name on the command line.
    pub name: &'static str,
    /// Adds its options to a command, with the line about the study.
    pub augment: fn(Command) -> Command,
    /// Whether a sweep can compute it in shards.
    pub has_shards: bool,
    /// Reads its options.
    ///
    /// # Errors
    /// What clap has against them.
    pub read: fn(&ArgMatches) -> Result<Box<dyn AnyOptions>, clap::Error>,
    /// Makes its sections of the page of figures.
    ///
    /// # Errors
    /// [`StudyError`] if one cannot be computed.
    pub sections: fn(&PageMaker<'_>) -> Result<Vec<PageSection>, StudyError>,
}

impl Entry {
    fn of<O: StudyOptions>() -> Self {
        Self {
            name: O::NAME,
            augment: O::augment_args,
            has_shards: O::HAS_SHARDS,
            read: |matches| Ok(Box::new(O::from_arg_matches(matches)?)),
            sections: O::sections,
        }
    }

    /// The study of this name.
    pub fn find(name: &str) -> Option<&'static Self> {
        STUDIES.iter().find(|entry| entry.name == name)
    }

    /// The study as a subcommand.
    pub fn command(&self) -> Command {
        (self.augment)(Command::new(self.name))
    }

    /// The same with more options after its own.
    pub fn augment_with<A: Args>(&self) -> Command {
        // The line about the study comes last, or that of the options would replace it.
        let about = self.command().get_about().cloned();
        let command = A::augment_args(self.command());
        about.map_or(command.clone(), |about| command.about(about))
    }
}

/// Options of any study.
pub trait AnyOptions {
    /// The study that is asked for, checked.
    ///
    /// # Errors
    /// [`StudyError`] naming the option or key that is wrong.
    fn study(&self) -> Result<Box<dyn AnyStudy>, StudyError>;

    /// The study as a table, if its rows can be computed apart.
    ///
    /// # Errors
    /// [`StudyError`] naming the option or key that is wrong.
    fn table(&self) -> Result<Option<Box<dyn tabular::Table>>, StudyError>;

    /// Names of the scenarios that the study starts from.
    fn scenarios(&self) -> Vec<String>;
}

impl<O: StudyOptions> AnyOptions for O {
    fn study(&self) -> Result<Box<dyn AnyStudy>, StudyError> {
        let study = StudyOptions::study(self)?;
        Ok(Box::new(Asked::<O>(study)))
    }

    fn table(&self) -> Result<Option<Box<dyn tabular::Table>>, StudyError> {
        StudyOptions::study(self).map(O::table)
    }

    fn scenarios(&self) -> Vec<String> {
        StudyOptions::scenarios(self)
    }
}

/// Called after every row.
pub type Progress<'a> = &'a (dyn Fn() + Sync);

/// Any study.
pub trait AnyStudy: Sync {
    /// How many rows it has.
    fn row_count(&self) -> usize;

    /// Computes it on the threads of the current rayon pool.
    ///
    /// # Errors
    /// The error of the first row that has one.
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
    /// The JSON object.
    ///
    /// # Errors
    /// If it cannot be written as JSON, which plain structs can.
    fn json(&self) -> Result<String, serde_json::Error>;

    /// The CSV file.
    ///
    /// # Errors
    /// If the lines cannot be written as CSV, which flat structs can.
    fn csv(&self) -> Result<Vec<u8>, csv::Error>;

    /// The table.
    fn table(&self) -> Table;

    /// The figure as SVG text.
    ///
    /// # Errors
    /// [`StudyError::Plot`] if it cannot be drawn.
    fn svg(&self) -> Result<String, StudyError>;
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

    fn svg(&self) -> Result<String, StudyError> {
        Ok(Figure::svg(self)?)
    }
}

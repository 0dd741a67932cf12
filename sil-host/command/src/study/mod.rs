//! `painleve study`: the studies of the catalogue on the command line. [`campaign`] reads their
//! options from a campaign file, [`outcome`] writes their results.

pub mod campaign;
pub mod outcome;

use clap::{ArgMatches, Args, Command, FromArgMatches, Subcommand};
use painleve_study::STUDIES;
use painleve_study_core::catalogue::{AnyOptions, CatalogueEntry};

use super::CommandError;
use outcome::OutcomeOptions;

/// Options of `painleve study`.
#[derive(Debug, Args)]
pub struct StudyArguments {
    #[command(subcommand)]
    study: StudyCommand,
}

/// A study with its options and its outputs.
struct StudyCommand {
    options: Box<dyn AnyOptions>,
    outcome: OutcomeOptions,
}

impl std::fmt::Debug for StudyCommand {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("StudyCommand").finish_non_exhaustive()
    }
}

impl Subcommand for StudyCommand {
    fn augment_subcommands(command: Command) -> Command {
        let study = |entry: &CatalogueEntry| entry.augment_with::<OutcomeOptions>();
        command
            .subcommand_required(true)
            .arg_required_else_help(true)
            .subcommands(STUDIES.iter().map(study))
    }

    fn augment_subcommands_for_update(command: Command) -> Command {
        Self::augment_subcommands(command)
    }

    fn has_subcommand(name: &str) -> bool {
        painleve_study::find(name).is_some()
    }
}

impl FromArgMatches for StudyCommand {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let missing = || clap::Error::new(clap::error::ErrorKind::MissingSubcommand);
        let (name, matches) = matches.subcommand().ok_or_else(missing)?;
        let entry = painleve_study::find(name).ok_or_else(missing)?;
        Ok(Self {
            options: (entry.read)(matches)?,
            outcome: OutcomeOptions::from_arg_matches(matches)?,
        })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

/// Computes a study and writes its results.
///
/// # Errors
/// [`CommandError`] if the study fails, a file cannot be written, or the user interrupts.
pub fn run(arguments: &StudyArguments) -> Result<(), CommandError> {
    let StudyCommand { options, outcome } = &arguments.study;
    outcome.make(&*options.study()?)
}

//! `painleve study`: the paper's studies from the command line.

mod admissible;
mod options;
mod regions;
mod sliding_range;

use clap::{Args, Subcommand};

use super::CommandError;

/// Options of `painleve study`.
#[derive(Debug, Args)]
pub struct StudyArguments {
    #[command(subcommand)]
    study: StudyCommand,
}

#[derive(Debug, Subcommand)]
enum StudyCommand {
    /// Table II: the tip positions at which p > 0, and the critical friction.
    Admissible(admissible::AdmissibleArguments),
    /// Fig. 3: the solution modes over θ1 and its rate, with the tip on the belt.
    Regions(regions::RegionsArguments),
    /// How far each controller slides before it leaves the belt.
    SlidingRange(sliding_range::SlidingRangeArguments),
}

/// Computes a study and writes what it came to.
pub fn run(arguments: &StudyArguments) -> Result<(), CommandError> {
    match &arguments.study {
        StudyCommand::Admissible(arguments) => admissible::run(arguments),
        StudyCommand::Regions(arguments) => regions::run(arguments),
        StudyCommand::SlidingRange(arguments) => sliding_range::run(arguments),
    }
}

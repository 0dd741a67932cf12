//! `painleve study`: the paper's studies from the command line. [`campaign`] reads their options
//! from a campaign file.

mod admissible;
mod bifurcation;
pub mod campaign;
mod capture;
mod cells;
mod closed_loop_bifurcation;
mod lift_off;
pub mod options;
mod poincare;
mod regions;
mod robustness;
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
    /// Fig. 4: where in friction and belt speed the arm keeps bouncing.
    Bifurcation(bifurcation::BifurcationArguments),
    /// Fig. 5: θ1 at each upward zero of θ̇1, and whether the motion is periodic or chaotic.
    Poincare(poincare::PoincareArguments),
    /// Fig. 12: over the belt's speed with the controller in the loop.
    ClosedLoopBifurcation(closed_loop_bifurcation::ClosedLoopBifurcationArguments),
    /// How far each controller slides before it leaves the belt.
    SlidingRange(sliding_range::SlidingRangeArguments),
    /// A campaign of random arms, belts, converters and losses that the controller is not told of.
    Robustness(robustness::RobustnessArguments),
    /// What each part of the controller contributes to the robustness campaign.
    Ablation(robustness::AblationArguments),
    /// How soon a bouncing arm is caught.
    Capture(capture::CaptureArguments),
    /// How soon a lift-off is noticed, with the force cell and without.
    LiftOff(lift_off::LiftOffArguments),
}

/// Computes a study and writes what it came to.
pub fn run(arguments: &StudyArguments) -> Result<(), CommandError> {
    match &arguments.study {
        StudyCommand::Admissible(arguments) => admissible::run(arguments),
        StudyCommand::Regions(arguments) => regions::run(arguments),
        StudyCommand::Bifurcation(arguments) => bifurcation::run(arguments),
        StudyCommand::Poincare(arguments) => poincare::run(arguments),
        StudyCommand::ClosedLoopBifurcation(arguments) => closed_loop_bifurcation::run(arguments),
        StudyCommand::SlidingRange(arguments) => sliding_range::run(arguments),
        StudyCommand::Robustness(arguments) => robustness::run(arguments),
        StudyCommand::Ablation(arguments) => robustness::run_ablation(arguments),
        StudyCommand::Capture(arguments) => capture::run(arguments),
        StudyCommand::LiftOff(arguments) => lift_off::run(arguments),
    }
}

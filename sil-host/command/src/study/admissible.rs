//! `painleve study admissible`: Table II.

use clap::Args;
use painleve_study::admissible::admissible;
use painleve_study::paper;

use super::options::{BaseOptions, OutcomeOptions};
use crate::CommandError;

/// Options of `painleve study admissible`.
#[derive(Debug, Args)]
pub struct AdmissibleArguments {
    /// Friction coefficient μ.
    #[arg(long, default_value_t = paper::FRICTION, allow_negative_numbers = true)]
    mu: f64,
    #[command(flatten)]
    base: BaseOptions,
    #[command(flatten)]
    outcome: OutcomeOptions,
}

/// Computes the intervals and writes them.
pub fn run(arguments: &AdmissibleArguments) -> Result<(), CommandError> {
    let scenario = arguments.base.load(&[("belt.friction", "--mu")])?;
    arguments.outcome.check()?;
    let outcome = admissible(&scenario.arm, arguments.mu)?;
    arguments.outcome.write(&outcome)
}

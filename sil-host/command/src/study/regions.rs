//! `painleve study regions`: Fig. 3.

use clap::{Args, ValueEnum};
use painleve_shared::Slip;
use painleve_study::regions::{Settings, Theta2, regions};
use painleve_study::{Grid, paper};

use super::options::{BaseOptions, OutcomeOptions};
use crate::CommandError;

/// A slip direction on the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum SlipOption {
    /// ż_r > 0, the paper's.
    Positive,
    /// ż_r < 0.
    Negative,
}

/// Options of `painleve study regions`.
#[derive(Debug, Args)]
pub struct RegionsArguments {
    /// Friction coefficient μ.
    #[arg(long, default_value_t = paper::FRICTION, allow_negative_numbers = true)]
    mu: f64,
    /// θ1 in degrees, FROM:TO:STEP or a list; what does not reach the belt is left out.
    #[arg(
        long,
        value_name = "GRID",
        default_value = "-37:37:0.5",
        allow_hyphen_values = true
    )]
    theta1_deg: Grid,
    /// Rate of θ1 in rad/s, FROM:TO:STEP or a list.
    #[arg(
        long,
        value_name = "GRID",
        default_value = "-8:8:0.2",
        allow_hyphen_values = true
    )]
    theta1_dot_rad_s: Grid,
    /// Which of the two θ2 that put the tip on the belt.
    #[arg(
        long,
        value_name = "SIGNS",
        value_enum,
        value_delimiter = ',',
        default_value = "positive,negative"
    )]
    theta2: Vec<Theta2>,
    /// Directions of slip.
    #[arg(
        long,
        value_name = "SIGNS",
        value_enum,
        value_delimiter = ',',
        default_value = "positive,negative"
    )]
    slip: Vec<SlipOption>,
    #[command(flatten)]
    base: BaseOptions,
    #[command(flatten)]
    outcome: OutcomeOptions,
}

/// Maps the modes and writes the maps.
pub fn run(arguments: &RegionsArguments) -> Result<(), CommandError> {
    let scenario = arguments.base.load(&[("belt.friction", "--mu")])?;
    arguments.outcome.check()?;
    let slips = arguments.slip.iter().map(|slip| match slip {
        SlipOption::Positive => Slip::Positive,
        SlipOption::Negative => Slip::Negative,
    });
    let settings = Settings {
        arm: scenario.arm,
        mu: arguments.mu,
        theta1_deg: arguments.theta1_deg.clone(),
        theta1_dot_rad_s: arguments.theta1_dot_rad_s.clone(),
        theta2: arguments.theta2.clone(),
        slips: slips.collect(),
    };
    let outcome = arguments.outcome.threads.in_pool(|| regions(&settings))??;
    arguments.outcome.write(&outcome)
}

//! `painleve study sliding-range`: how far each controller slides.

use clap::Args;

use super::options::{OutcomeOptions, Overrides, PostureOption, metres, seconds};
use crate::commands::CommandError;
use crate::study::Grid;
use crate::study::case::{Controller, Converters, Reference};
use crate::study::sliding_range::{Criterion, SlidingRange, SlidingRanges};

/// Options of `painleve study sliding-range`.
#[derive(Debug, Args)]
pub struct SlidingRangeArguments {
    /// pid, hybrid-paper (the paper's law and gains), hybrid-paper-model (the same with known
    /// friction), hybrid (as built in), or any scenario or file.
    #[arg(
        long,
        value_name = "NAMES",
        value_delimiter = ',',
        default_value = "pid,hybrid-paper,hybrid-paper-model,hybrid"
    )]
    controller: Vec<Controller>,
    /// Ideal (as in the paper), hardware, or the scenario's own.
    #[arg(
        long,
        value_name = "SETS",
        value_enum,
        value_delimiter = ',',
        default_value = "ideal,hardware"
    )]
    converters: Vec<Converters>,
    /// Postures to start in.
    #[arg(
        long,
        value_name = "POSTURES",
        value_enum,
        value_delimiter = ',',
        default_value = "elbow-down,elbow-up"
    )]
    posture: Vec<PostureOption>,
    /// Friction coefficients μ, FROM:TO:STEP or a list.
    #[arg(
        long,
        value_name = "GRID",
        default_value = "0.6",
        allow_hyphen_values = true
    )]
    mu: Grid,
    /// minimum-jerk:SECONDS, ramp:SECONDS or step; several with commas.
    #[arg(
        long,
        value_name = "REFERENCES",
        value_delimiter = ',',
        default_value = "minimum-jerk:3"
    )]
    reference: Vec<Reference>,
    /// How near the tip must come to its target, m.
    #[arg(
        long,
        value_name = "METRES",
        default_value_t = Criterion::default().within_m,
        value_parser = metres,
        allow_negative_numbers = true
    )]
    within_m: f64,
    /// How long after the end of the reference it may take for that, s.
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = Criterion::default().patience_s,
        value_parser = seconds,
        allow_negative_numbers = true
    )]
    patience_s: f64,
    /// Distance of the targets that are tried first, m.
    #[arg(
        long,
        value_name = "METRES",
        default_value_t = Criterion::default().scan_step_m,
        value_parser = metres,
        allow_negative_numbers = true
    )]
    scan_step_m: f64,
    /// Accuracy of the result, m.
    #[arg(
        long,
        value_name = "METRES",
        default_value_t = Criterion::default().resolution_m,
        value_parser = metres,
        allow_negative_numbers = true
    )]
    resolution_m: f64,
    #[command(flatten)]
    overrides: Overrides,
    #[command(flatten)]
    outcome: OutcomeOptions,
}

/// Searches the ranges and writes them.
pub fn run(arguments: &SlidingRangeArguments) -> Result<(), CommandError> {
    arguments.overrides.refuse(&[
        ("belt.friction", "--mu"),
        ("initial", "--posture"),
        ("controller.reference", "--reference"),
        ("run.duration_s", "--patience-s"),
    ])?;
    let study = SlidingRange {
        controllers: arguments.controller.clone(),
        converters: arguments.converters.clone(),
        postures: arguments
            .posture
            .iter()
            .map(|&posture| posture.into())
            .collect(),
        mu: arguments.mu.values().to_vec(),
        references: arguments.reference.clone(),
        overrides: arguments.overrides.overrides.clone(),
        criterion: Criterion {
            within_m: arguments.within_m,
            patience_s: arguments.patience_s,
            scan_step_m: arguments.scan_step_m,
            resolution_m: arguments.resolution_m,
            ..Criterion::default()
        },
    };
    study.check()?;
    let rows = arguments.outcome.compute(&study)?;
    arguments.outcome.write(&SlidingRanges { rows })
}

//! `painleve study sliding-range`: how far each controller slides.

use clap::Args;
use painleve_study::case::{self, Controller, Converters, Reference};
use painleve_study::sliding_range::{Criterion, SlidingRange, SlidingRanges};
use painleve_study::{Grid, StudyError};

use super::options::{OutcomeOptions, Overrides, PostureOption, metres, seconds};
use crate::CommandError;

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

impl SlidingRangeArguments {
    /// The study that is asked for, checked.
    ///
    /// # Errors
    /// [`StudyError`] naming the option or key that is wrong.
    pub fn study(&self) -> Result<SlidingRange, StudyError> {
        self.overrides.refuse(&[
            ("belt.friction", "--mu"),
            ("initial", "--posture"),
            ("controller.reference", "--reference"),
            ("run.duration_s", "--patience-s"),
        ])?;
        let study = SlidingRange {
            controllers: self.controller.clone(),
            converters: self.converters.clone(),
            postures: self.posture.iter().map(|&posture| posture.into()).collect(),
            mu: self.mu.values().to_vec(),
            references: self.reference.clone(),
            overrides: self.overrides.overrides.clone(),
            criterion: Criterion {
                within_m: self.within_m,
                patience_s: self.patience_s,
                scan_step_m: self.scan_step_m,
                resolution_m: self.resolution_m,
                ..Criterion::default()
            },
        };
        study.check()?;
        Ok(study)
    }

    /// The scenarios of its own that it starts from.
    pub fn scenarios(&self) -> Vec<&str> {
        case::own_scenarios(&self.controller)
    }
}

/// Searches the ranges and writes them.
pub fn run(arguments: &SlidingRangeArguments) -> Result<(), CommandError> {
    let study = arguments.study()?;
    let rows = arguments.outcome.compute(&study)?;
    arguments.outcome.write(&SlidingRanges { rows })
}

//! Options of the study: how far each controller slides.

use clap::Args;

use super::{Criterion, Row, SlidingRange, SlidingRanges, page};
use crate::case::{self, ControllerChoice, ConverterChoice, Reference};
use crate::catalogue::{PageSection, StudyOptions, in_shards};
use crate::figures::page_maker::PageMaker;
use crate::tabular::Table;
use crate::{Grid, StudyError};

use crate::options::{Overrides, PostureOption, metres, seconds};

/// How far each controller slides before its tip leaves the belt.
#[derive(Debug, Args)]
pub struct Options {
    /// Controllers: pid, hybrid-paper (the paper's law and gains), hybrid-paper-model (the same
    /// with known friction), hybrid (as built in), or any scenario or file.
    #[arg(
        long,
        value_name = "NAMES",
        value_delimiter = ',',
        default_value = "pid,hybrid-paper,hybrid-paper-model,hybrid"
    )]
    controller: Vec<ControllerChoice>,
    /// Converters: ideal (as in the paper), hardware, or the scenario's own.
    #[arg(
        long,
        value_name = "SETS",
        value_enum,
        value_delimiter = ',',
        default_value = "ideal,hardware"
    )]
    converters: Vec<ConverterChoice>,
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
    /// References: minimum-jerk:SECONDS, ramp:SECONDS or step; separate several with commas.
    #[arg(
        long,
        value_name = "REFERENCES",
        value_delimiter = ',',
        default_value = "minimum-jerk:3"
    )]
    reference: Vec<Reference>,
    /// Largest distance from the target at which it counts as reached, m.
    #[arg(
        long,
        value_name = "METRES",
        default_value_t = Criterion::default().within_m,
        value_parser = metres,
        allow_negative_numbers = true
    )]
    within_m: f64,
    /// Longest settling time after the end of the reference, s.
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = Criterion::default().patience_s,
        value_parser = seconds,
        allow_negative_numbers = true
    )]
    patience_s: f64,
    /// Spacing of the targets tried first, m.
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
}

impl StudyOptions for Options {
    const NAME: &'static str = "sliding-range";
    const HAS_SHARDS: bool = true;
    type Study = SlidingRange;
    type Outcome = SlidingRanges;

    fn study(&self) -> Result<SlidingRange, StudyError> {
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

    fn scenarios(&self) -> Vec<String> {
        let own = case::own_scenarios(&self.controller);
        own.into_iter().map(str::to_owned).collect()
    }

    fn outcome(_: &SlidingRange, rows: Vec<Row>) -> SlidingRanges {
        SlidingRanges { rows }
    }

    fn table(study: SlidingRange) -> Option<Box<dyn Table>> {
        in_shards(study)
    }

    fn sections(page: &PageMaker<'_>) -> Result<Vec<PageSection>, StudyError> {
        page::sections(page)
    }
}

//! Options of the study: how far the tip slides under each controller.

use clap::Args;
use painleve_study_core::StudyError;
use painleve_study_core::case::{ConverterChoice, Reference};
use painleve_study_core::catalogue::{InShards, PageSection, StudyOptions, in_shards};
use painleve_study_core::figures::page_maker::PageMaker;
use painleve_study_core::grid::once;
use painleve_study_core::options::{
    ControllerOptions, ConverterOptions, FrictionGrid, Overrides, PostureOption, metres, number,
};

use super::{Criterion, Row, SlidingRange, SlidingRanges, page};

const CONVERTERS_HELP: &str = "Converters: ideal (as in the paper), hardware, or the scenario's own; by default own if a \
    controller is a scenario or file, or else ideal,hardware";

/// How far the tip slides under each controller before it leaves the belt.
///
/// Targets lie in the direction in which the surface of the belt comes, as does the edge. The range ends at the farthest
/// target before the first that fails; `fails by` says how: p = 0 or the end of the reach is the limit, or the tip lifts off,
/// stops short or late, or the controller latches a fault. Targets reached beyond it are in brackets; `–` is a range without
/// any target.
#[derive(Debug, Args)]
#[command(
    mut_arg("controller", |controller| {
        controller.default_value("pid,hybrid-paper,hybrid-paper-model,hybrid")
    }),
    mut_arg("converters", |converters| converters.help(CONVERTERS_HELP))
)]
pub struct Options {
    #[command(flatten)]
    controllers: ControllerOptions,
    #[command(flatten)]
    converters: ConverterOptions,
    /// Postures to start in.
    #[arg(
        long,
        value_name = "POSTURES",
        value_enum,
        value_delimiter = ',',
        default_value = "elbow-down,elbow-up"
    )]
    posture: Vec<PostureOption>,
    #[command(flatten)]
    friction: FrictionGrid,
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
        value_parser = metres
    )]
    within_m: f64,
    /// Longest settling time after the end of the reference, s.
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = Criterion::default().patience_s,
        value_parser = patience
    )]
    patience_s: f64,
    /// Spacing of the targets tried first, m.
    #[arg(
        long,
        value_name = "METRES",
        default_value_t = Criterion::default().scan_step_m,
        value_parser = metres
    )]
    scan_step_m: f64,
    /// Accuracy of the result, m.
    #[arg(
        long,
        value_name = "METRES",
        default_value_t = Criterion::default().resolution_m,
        value_parser = metres
    )]
    resolution_m: f64,
    #[command(flatten)]
    overrides: Overrides,
}

/// Reads a time limit, within which the tip must be able to stay at its target for long enough.
fn patience(text: &str) -> Result<f64, String> {
    number(text, Criterion::default().stay_s..=1e6, "seconds")
}

impl StudyOptions for Options {
    const NAME: &'static str = "sliding-range";
    const IN_SHARDS: Option<InShards<Self::Study>> = Some(in_shards);
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
            controllers: once(&self.controllers.controller),
            converters: self.converters.of(
                &self.controllers.controller,
                &[ConverterChoice::Ideal, ConverterChoice::Hardware],
            ),
            postures: once(&self.posture).into_iter().map(Into::into).collect(),
            mu: self.friction.of_controllers(&self.controllers.controller)?,
            references: once(&self.reference),
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

    fn outcome(_: &SlidingRange, rows: Vec<Row>) -> SlidingRanges {
        SlidingRanges { rows }
    }

    fn sections(page: &PageMaker<'_>) -> Result<Vec<PageSection>, StudyError> {
        page::sections(page)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_within_which_no_target_can_be_reached_is_refused() {
        assert_eq!(patience("2"), Ok(2.0));
        for text in ["1.9", "0", "-3", "nan", "long"] {
            let message = patience(text).unwrap_err();
            assert_eq!(message, "give seconds from 2 to 1000000", "{text}");
        }
    }
}

//! Options of the study of loops.

use clap::Args;
use painleve_plant::mechanics::compliant::ContactKind;

use super::{LoopMargins, LoopOutcome, Row};
use painleve_study_core::catalogue::{InShards, StudyOptions, in_shards};
use painleve_study_core::grid::once;
use painleve_study_core::options::{ControllerOptions, Overrides, PostureOption, number};
use painleve_study_core::{Grid, Study, StudyError};

/// The sampled loop in the frequency domain: Bode plots, margins and steps along the belt.
#[derive(Debug, Args)]
#[command(mut_arg("controller", |controller| controller.default_value("hybrid,pid")))]
pub struct Options {
    #[command(flatten)]
    controllers: ControllerOptions,
    /// The side to which the elbow bends.
    #[arg(long, value_name = "POSTURE", value_enum, default_value = "elbow-down")]
    posture: PostureOption,
    /// Places of the tip, m, FROM:TO:STEP or a list.
    #[arg(
        long,
        value_name = "GRID",
        default_value = "-0.14,-0.08,-0.02,0.03,0.08,0.14",
        allow_hyphen_values = true
    )]
    tip: Grid,
    /// Number of frequencies, from 1 Hz to a fifth of the control rate.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 20,
        value_parser = |text: &str| number(text, 2_u16..=200, "a whole number")
    )]
    frequencies: u16,
    #[command(flatten)]
    overrides: Overrides,
}

impl StudyOptions for Options {
    const NAME: &'static str = "loop";
    const IN_SHARDS: Option<InShards<Self::Study>> = Some(in_shards);
    type Study = LoopMargins;
    type Outcome = LoopOutcome;

    fn study(&self) -> Result<LoopMargins, StudyError> {
        self.overrides
            .refuse(&[("initial", "--tip"), ("controller.reference", "--tip")])?;
        self.overrides.refuse_law()?;
        let study = LoopMargins {
            controllers: once(&self.controllers.controller),
            posture: self.posture.into(),
            tips_m: self.tip.values().to_vec(),
            frequencies: self.frequencies.into(),
            overrides: self.overrides.overrides.clone(),
        };
        study.check()?;
        for index in 0..study.len() {
            // There the study switches the estimate of the response off.
            if study.scenario(index, &[])?.contact.kind == ContactKind::Rigid {
                self.overrides
                    .refuse_fixed(&["controller.response.enabled"])?;
            }
        }
        Ok(study)
    }

    fn outcome(_: &LoopMargins, rows: Vec<Row>) -> LoopOutcome {
        LoopOutcome { rows }
    }
}

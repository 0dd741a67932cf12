//! Options of the study of loops.

use clap::Args;
use painleve_plant::mechanics::compliant::ContactKind;
use painleve_shared::{Arm, ArmParameters};

use super::{LoopMargins, LoopOutcome, Row};
use painleve_study_core::case::{self, ConverterChoice};
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
    /// Places of the tip, m, FROM:TO:STEP or a list; by default -0.14,-0.08,-0.02,0.03,0.08,0.14, of an arm of another shape at
    /// the same fractions of its reach.
    #[arg(long, value_name = "GRID", allow_hyphen_values = true)]
    tip: Option<Grid>,
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

/// Places of the tip of the paper's arm, m.
const TIPS_M: [f64; 6] = [-0.14, -0.08, -0.02, 0.03, 0.08, 0.14];

impl Options {
    /// Returns places within reach of every controller's arm, m.
    fn usual_tips_m(&self) -> Result<Vec<f64>, StudyError> {
        let of_paper_m = Arm::new(ArmParameters::<f64>::default())?.reach_on_belt_m();
        let mut reach_m = f64::INFINITY;
        for controller in &self.controllers.controller {
            let (own, changes) = (ConverterChoice::Own, &self.overrides.overrides);
            let scenario = case::scenario(controller, self.posture.into(), own, changes)?;
            reach_m = reach_m.min(Arm::new(scenario.arm)?.reach_on_belt_m());
        }
        Ok(TIPS_M.map(|tip_m| tip_m * (reach_m / of_paper_m)).to_vec())
    }
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
        let tips_m = match &self.tip {
            Some(grid) => grid.values().to_vec(),
            None => self.usual_tips_m()?,
        };
        let study = LoopMargins {
            controllers: once(&self.controllers.controller),
            posture: self.posture.into(),
            tips_m,
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

//! Options of the study: Fig. 12.

use clap::Args;
use painleve_study_core::StudyError;
use painleve_study_core::case::{ConverterChoice, Reference};
use painleve_study_core::catalogue::{InShards, PageSection, StudyOptions, in_shards};
use painleve_study_core::figures::page_maker::PageMaker;
use painleve_study_core::grid::once;
use painleve_study_core::options::{
    BeltSpeedGrid, ControllerOptions, ConverterOptions, FrictionGrid, InitialOptions, Overrides,
    RecordingOptions,
};

use super::{ClosedLoopBifurcation, ClosedLoopDiagram, Row, page};

const INITIAL_HELP: &str =
    "Initial conditions, for example d,u,a,random:3; the controller uses the posture of each";

/// Fig. 12: bifurcation diagram over the belt speed with the controller in the loop.
#[derive(Debug, Args)]
#[command(
    mut_arg("initial", |initial| initial.default_value("d").help(INITIAL_HELP)),
    mut_arg("transient_s", |transient_s| transient_s.default_value("20")),
    mut_arg("record_s", |record_s| record_s.default_value("10"))
)]
pub struct Options {
    #[command(flatten)]
    controllers: ControllerOptions,
    #[command(flatten)]
    converters: ConverterOptions,
    #[command(flatten)]
    friction: FrictionGrid,
    #[command(flatten)]
    belt: BeltSpeedGrid,
    #[command(flatten)]
    initial: InitialOptions,
    /// Reference: minimum-jerk:SECONDS, ramp:SECONDS or step.
    #[arg(long, default_value = "minimum-jerk:3")]
    reference: Reference,
    /// Target of the reference, m; by default that of the controller's scenario or file, or the paper's farthest target for the
    /// law and posture.
    #[arg(long, value_name = "METRES")]
    target_m: Option<f64>,
    #[command(flatten)]
    recording: RecordingOptions,
    #[command(flatten)]
    overrides: Overrides,
}

impl StudyOptions for Options {
    const NAME: &'static str = "closed-loop-bifurcation";
    const IN_SHARDS: Option<InShards<Self::Study>> = Some(in_shards);
    type Study = ClosedLoopBifurcation;
    type Outcome = ClosedLoopDiagram;

    fn study(&self) -> Result<ClosedLoopBifurcation, StudyError> {
        self.overrides.refuse(&[
            ("belt.friction", "--mu"),
            ("belt.profile", "--v-belt"),
            ("initial", "--initial"),
            ("controller.reference", "--reference and --target-m"),
            ("run.duration_s", "--transient-s and --record-s"),
        ])?;
        let study = ClosedLoopBifurcation {
            controllers: once(&self.controllers.controller),
            converters: self
                .converters
                .of(&self.controllers.controller, &[ConverterChoice::Hardware]),
            mu: self.friction.of_controllers(&self.controllers.controller)?,
            v_belt_m_s: self.belt.v_belt.values().to_vec(),
            initial: self.initial.initial.list().to_vec(),
            seed: self.initial.seed,
            reference: self.reference,
            target_m: self.target_m,
            transient_s: self.recording.transient_s,
            record_s: self.recording.record_s,
            overrides: self.overrides.overrides.clone(),
        };
        study.check()?;
        Ok(study)
    }

    fn outcome(_: &ClosedLoopBifurcation, rows: Vec<Row>) -> ClosedLoopDiagram {
        ClosedLoopDiagram::new(rows)
    }

    fn sections(page: &PageMaker<'_>) -> Result<Vec<PageSection>, StudyError> {
        page::sections(page)
    }
}

//! Options of the study: Fig. 12.

use clap::Args;

use super::{ClosedLoopBifurcation, ClosedLoopDiagram, Row, page};
use crate::case::{self, ControllerChoice, ConverterChoice, Reference};
use crate::catalogue::{PageSection, StudyOptions, in_shards};
use crate::figures::page_maker::PageMaker;
use crate::initial::Initials;
use crate::tabular::Table;
use crate::{Grid, StudyError};

use crate::options::{Overrides, seconds};

/// Fig. 12: bifurcation diagram over the belt speed with the controller in the loop.
#[derive(Debug, Args)]
pub struct Options {
    /// Controllers: pid, hybrid-paper (the paper's law and gains), hybrid-paper-model (the same
    /// with known friction), hybrid (as built in), or any scenario or file.
    #[arg(
        long,
        value_name = "NAMES",
        value_delimiter = ',',
        default_value = "hybrid"
    )]
    controller: Vec<ControllerChoice>,
    /// Converters: ideal (as in the paper), hardware, or the scenario's own.
    #[arg(
        long,
        value_name = "SETS",
        value_enum,
        value_delimiter = ',',
        default_value = "hardware"
    )]
    converters: Vec<ConverterChoice>,
    /// Friction coefficients μ, FROM:TO:STEP or a list.
    #[arg(
        long,
        value_name = "GRID",
        default_value = "0.6",
        allow_hyphen_values = true
    )]
    mu: Grid,
    /// Belt speeds, m/s.
    #[arg(
        long,
        value_name = "GRID",
        default_value = "-1:-0.1:0.005",
        allow_hyphen_values = true
    )]
    v_belt: Grid,
    /// Initial conditions, for example d,u,a,random:3; the controller uses the posture of each.
    #[arg(long, value_name = "LIST", default_value = "d")]
    initial: Initials,
    /// Seed of the random initial conditions.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Reference: minimum-jerk:SECONDS, ramp:SECONDS or step.
    #[arg(long, default_value = "minimum-jerk:3")]
    reference: Reference,
    /// Target of the reference, m; by default the paper's farthest target for the law and posture.
    #[arg(long, value_name = "METRES", allow_negative_numbers = true)]
    target_m: Option<f64>,
    /// Transient of each cell before recording starts, s; 250 in the paper.
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = 20.0,
        value_parser = seconds,
        allow_negative_numbers = true
    )]
    transient_s: f64,
    /// Recording time of each cell, s; 50 in the paper.
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = 10.0,
        value_parser = seconds,
        allow_negative_numbers = true
    )]
    record_s: f64,
    #[command(flatten)]
    overrides: Overrides,
}

impl StudyOptions for Options {
    const NAME: &'static str = "closed-loop-bifurcation";
    const HAS_SHARDS: bool = true;
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
            controllers: self.controller.clone(),
            converters: self.converters.clone(),
            mu: self.mu.values().to_vec(),
            v_belt_m_s: self.v_belt.values().to_vec(),
            initial: self.initial.list().to_vec(),
            seed: self.seed,
            reference: self.reference,
            target_m: self.target_m,
            transient_s: self.transient_s,
            record_s: self.record_s,
            overrides: self.overrides.overrides.clone(),
        };
        study.check()?;
        Ok(study)
    }

    fn scenarios(&self) -> Vec<String> {
        let own = case::own_scenarios(&self.controller);
        own.into_iter().map(str::to_owned).collect()
    }

    fn outcome(_: &ClosedLoopBifurcation, rows: Vec<Row>) -> ClosedLoopDiagram {
        ClosedLoopDiagram::new(rows)
    }

    fn table(study: ClosedLoopBifurcation) -> Option<Box<dyn Table>> {
        in_shards(study)
    }

    fn sections(page: &PageMaker<'_>) -> Result<Vec<PageSection>, StudyError> {
        page::sections(page)
    }
}

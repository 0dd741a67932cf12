//! Options of the study: Fig. 5.

use clap::Args;
use painleve_study_core::StudyError;
use painleve_study_core::catalogue::{InShards, PageSection, StudyOptions, in_shards};
use painleve_study_core::figures::page_maker::PageMaker;

use super::{Poincare, PoincareDiagram, Row, page};
use crate::cell_options::CellOptions;

const MU_HELP: &str = "Friction coefficients μ, FROM:TO:STEP or a list; the figure shows the first";

/// Fig. 5: θ1 at each upward zero of θ̇1, and whether the motion is periodic or chaotic.
#[derive(Debug, Args)]
#[command(
    mut_arg("mu", |mu| mu.help(MU_HELP)),
    mut_arg("v_belt", |v_belt| v_belt.default_value("-0.6:-0.28:0.001"))
)]
pub struct Options {
    #[command(flatten)]
    cells: CellOptions,
}

impl StudyOptions for Options {
    const NAME: &'static str = "poincare";
    const IN_SHARDS: Option<InShards<Self::Study>> = Some(in_shards);
    type Study = Poincare;
    type Outcome = PoincareDiagram;

    fn study(&self) -> Result<Poincare, StudyError> {
        let cells = self.cells.cells()?;
        Ok(Poincare { cells })
    }

    fn outcome(study: &Poincare, rows: Vec<Row>) -> PoincareDiagram {
        PoincareDiagram::new(study, rows)
    }

    fn sections(page: &PageMaker<'_>) -> Result<Vec<PageSection>, StudyError> {
        page::sections(page)
    }
}

//! Options of the study: Fig. 5.

use clap::Args;

use super::{Poincare, PoincareDiagram, Row, page};
use crate::catalogue::{PageSection, StudyOptions, in_shards};
use crate::figures::page_maker::PageMaker;
use crate::tabular::Table;
use crate::{Grid, StudyError};

use crate::cell_options::CellOptions;

/// Fig. 5: θ1 at each upward zero of θ̇1, and whether the motion is periodic or chaotic.
#[derive(Debug, Args)]
pub struct Options {
    /// Friction coefficients μ, FROM:TO:STEP or a list; the figure shows the first.
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
        default_value = "-0.6:-0.28:0.001",
        allow_hyphen_values = true
    )]
    v_belt: Grid,
    #[command(flatten)]
    cells: CellOptions,
}

impl StudyOptions for Options {
    const NAME: &'static str = "poincare";
    const HAS_SHARDS: bool = true;
    type Study = Poincare;
    type Outcome = PoincareDiagram;

    fn study(&self) -> Result<Poincare, StudyError> {
        let cells = self.cells.cells(&self.mu, &self.v_belt)?;
        Ok(Poincare { cells })
    }

    fn scenarios(&self) -> Vec<String> {
        vec![self.cells.scenario().to_owned()]
    }

    fn outcome(study: &Poincare, rows: Vec<Row>) -> PoincareDiagram {
        PoincareDiagram::new(study, rows)
    }

    fn table(study: Poincare) -> Option<Box<dyn Table>> {
        in_shards(study)
    }

    fn sections(page: &PageMaker<'_>) -> Result<Vec<PageSection>, StudyError> {
        page::sections(page)
    }
}

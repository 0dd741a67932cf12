//! Options of the study: Fig. 4.

use clap::Args;

use super::{Bifurcation, BifurcationDiagram, Row, page};
use crate::catalogue::{PageSection, StudyOptions, in_shards};
use crate::figures::page_maker::PageMaker;
use crate::tabular::Table;
use crate::{Grid, StudyError};

use crate::cell_options::CellOptions;

/// Fig. 4: friction and belt speeds at which the arm keeps bouncing.
#[derive(Debug, Args)]
pub struct Options {
    /// Friction coefficients μ, FROM:TO:STEP or a list; a single value draws a section.
    #[arg(
        long,
        value_name = "GRID",
        default_value = "0.1:1:0.1",
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
    #[command(flatten)]
    cells: CellOptions,
}

impl StudyOptions for Options {
    const NAME: &'static str = "bifurcation";
    const HAS_SHARDS: bool = true;
    type Study = Bifurcation;
    type Outcome = BifurcationDiagram;

    fn study(&self) -> Result<Bifurcation, StudyError> {
        let cells = self.cells.cells(&self.mu, &self.v_belt)?;
        Ok(Bifurcation { cells })
    }

    fn scenarios(&self) -> Vec<String> {
        vec![self.cells.scenario().to_owned()]
    }

    fn outcome(study: &Bifurcation, rows: Vec<Row>) -> BifurcationDiagram {
        BifurcationDiagram::new(study, rows)
    }

    fn table(study: Bifurcation) -> Option<Box<dyn Table>> {
        in_shards(study)
    }

    fn sections(page: &PageMaker<'_>) -> Result<Vec<PageSection>, StudyError> {
        page::sections(page)
    }
}

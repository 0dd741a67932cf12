//! Options of the study: Fig. 4.

use clap::Args;
use painleve_study_core::StudyError;
use painleve_study_core::catalogue::{InShards, PageSection, StudyOptions, in_shards};
use painleve_study_core::figures::page_maker::PageMaker;

use super::{Bifurcation, BifurcationDiagram, Row, page};
use crate::cell_options::CellOptions;

const MU_HELP: &str =
    "Friction coefficients μ, FROM:TO:STEP or a list; a single value draws a section";

/// Fig. 4: friction and belt speeds at which the arm keeps bouncing.
#[derive(Debug, Args)]
#[command(mut_arg("mu", |mu| mu.default_value("0.1:1:0.1").help(MU_HELP)))]
pub struct Options {
    #[command(flatten)]
    cells: CellOptions,
}

impl StudyOptions for Options {
    const NAME: &'static str = "bifurcation";
    const IN_SHARDS: Option<InShards<Self::Study>> = Some(in_shards);
    type Study = Bifurcation;
    type Outcome = BifurcationDiagram;

    fn study(&self) -> Result<Bifurcation, StudyError> {
        let cells = self.cells.cells()?;
        Ok(Bifurcation { cells })
    }

    fn outcome(study: &Bifurcation, rows: Vec<Row>) -> BifurcationDiagram {
        BifurcationDiagram::new(study, rows)
    }

    fn sections(page: &PageMaker<'_>) -> Result<Vec<PageSection>, StudyError> {
        page::sections(page)
    }
}

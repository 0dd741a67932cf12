//! Options of the study.

use clap::Args;
use painleve_study_core::StudyError;
use painleve_study_core::catalogue::{PageSection, StudyOptions};
use painleve_study_core::figures::page_maker::PageMaker;
use painleve_study_core::options::BaseOptions;

use super::{Admissible, AdmissibleStudy, page};
use crate::printed;

/// Table II: tip positions at which p > 0, and the critical friction.
#[derive(Debug, Args)]
pub struct Options {
    /// Friction coefficient μ.
    #[arg(long, default_value_t = printed::FRICTION)]
    mu: f64,
    #[command(flatten)]
    base: BaseOptions,
}

impl StudyOptions for Options {
    const NAME: &'static str = "admissible";
    type Study = AdmissibleStudy;
    type Outcome = Admissible;

    fn study(&self) -> Result<AdmissibleStudy, StudyError> {
        let scenario = self
            .base
            .load_rigid(&[("belt.friction", "--mu")], &["arm"])?;
        Ok(AdmissibleStudy {
            arm: scenario.arm,
            mu: self.mu,
        })
    }

    fn outcome(_: &AdmissibleStudy, mut rows: Vec<Admissible>) -> Admissible {
        // The study has one row.
        rows.remove(0)
    }

    fn sections(page: &PageMaker<'_>) -> Result<Vec<PageSection>, StudyError> {
        page::sections(page)
    }
}

//! Options of the study.

use clap::Args;
use painleve_study_core::StudyError;
use painleve_study_core::catalogue::{PageSection, StudyOptions};
use painleve_study_core::figures::page_maker::PageMaker;
use painleve_study_core::options::BaseOptions;

use super::{Admissible, AdmissibleStudy, check_friction, page};

/// Table II: tip positions at which p > 0, and the critical friction.
#[derive(Debug, Args)]
pub struct Options {
    /// Friction coefficient μ; the scenario's by default.
    #[arg(long)]
    mu: Option<f64>,
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
            .load_rigid(&[("belt.friction", "--mu")], &["arm", "belt"])?;
        let mu = self.mu.unwrap_or(scenario.belt.friction);
        check_friction(mu)?;
        Ok(AdmissibleStudy {
            arm: scenario.arm,
            slip: scenario.slip_at_rest(),
            mu,
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

//! Options of the study.

use clap::{Args, ValueEnum};
use painleve_study_core::StudyError;
use painleve_study_core::catalogue::StudyOptions;
use painleve_study_core::grid::once;
use painleve_study_core::options::RandomRuns;

use super::{Ablation, AblationStudy, Condition};
use crate::robustness::{Part, Row};

/// Contribution of each part of the controller to the share of runs in which the tip is kept on the belt.
#[derive(Debug, Args)]
#[command(
    mut_arg("runs", |runs| runs.default_value("100").help("Number of runs with each part switched off under each condition"))
)]
pub struct Options {
    /// Conditions; all by default.
    #[arg(
        long = "on",
        value_name = "CONDITIONS",
        value_enum,
        value_delimiter = ','
    )]
    conditions: Vec<Condition>,
    /// Parts of the controller to switch off, one at a time; all parts by default.
    #[arg(long, value_name = "PARTS", value_enum, value_delimiter = ',')]
    without: Vec<Part>,
    #[command(flatten)]
    runs: RandomRuns,
}

impl StudyOptions for Options {
    const NAME: &'static str = "ablation";
    type Study = AblationStudy;
    type Outcome = Ablation;

    fn study(&self) -> Result<AblationStudy, StudyError> {
        self.runs.set.refuse(&[("contact.kind", "--on")])?;
        let study = AblationStudy {
            conditions: or_all(&self.conditions, Condition::value_variants()),
            parts: or_all(&self.without, Part::value_variants()),
            seed: self.runs.seed,
            runs: self.runs.runs,
            overrides: self.runs.overrides(),
        };
        for condition in &study.conditions {
            self.runs.set.refuse_fixed(condition.fixed_keys())?;
        }
        study.check()?;
        Ok(study)
    }

    fn outcome(study: &AblationStudy, rows: Vec<Row>) -> Ablation {
        Ablation::new(study, &rows)
    }
}

/// Returns what was chosen, each once, or all if nothing was.
fn or_all<T: Clone + PartialEq>(chosen: &[T], all: &[T]) -> Vec<T> {
    once(if chosen.is_empty() { all } else { chosen })
}

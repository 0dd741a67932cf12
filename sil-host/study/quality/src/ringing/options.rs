//! Options of the study of ringing.

use clap::Args;
use painleve_study_core::catalogue::{InShards, StudyOptions, in_shards};
use painleve_study_core::options::Overrides;
use painleve_study_core::{Grid, StudyError};

use super::{Ringing, RingingOutcome, Row};

/// Where the friction observer makes a compliant contact ring, beside the stability limit.
#[derive(Debug, Args)]
pub struct Options {
    /// Dampings of the contact, N·s/m.
    #[arg(long, value_name = "GRID", default_value = "38,76,152")]
    damping: Grid,
    /// Rates λ of the friction observer, 1/s.
    #[arg(
        long,
        value_name = "GRID",
        default_value = "10,20,33,50,67,100,150,200,300"
    )]
    rate: Grid,
    /// Stiffness of the contact, N/m.
    #[arg(long, value_name = "N/M", default_value_t = 1e5)]
    stiffness: f64,
    #[command(flatten)]
    overrides: Overrides,
}

impl StudyOptions for Options {
    const NAME: &'static str = "ringing";
    const IN_SHARDS: Option<InShards<Self::Study>> = Some(in_shards);
    type Study = Ringing;
    type Outcome = RingingOutcome;

    fn study(&self) -> Result<Ringing, StudyError> {
        self.overrides.refuse(&[
            ("contact.kind", "--stiffness"),
            ("contact.stiffness_n_m", "--stiffness"),
            ("contact.normal", "--damping"),
            ("controller.law.hybrid.friction", "--rate"),
        ])?;
        self.overrides.refuse_fixed(&[
            "initial",
            "controller.reference",
            "controller.friction.first_guess",
            "controller.law.hybrid.force_integral_gain_per_s",
            "run.duration_s",
        ])?;
        let study = Ringing {
            stiffness_n_m: self.stiffness,
            dampings_ns_m: self.damping.values().to_vec(),
            rates_per_s: self.rate.values().to_vec(),
            overrides: self.overrides.overrides.clone(),
        };
        study.check()?;
        Ok(study)
    }

    fn outcome(study: &Ringing, rows: Vec<Row>) -> RingingOutcome {
        RingingOutcome {
            stiffness_n_m: study.stiffness_n_m,
            rows,
        }
    }
}

//! Options of the study of stiffness.

use clap::Args;
use painleve_shared::range;
use painleve_study_core::catalogue::{InShards, StudyOptions, in_shards};
use painleve_study_core::options::{BaseOptions, seconds};
use painleve_study_core::{Grid, StudyError};

use super::{Row, Stiffness, StiffnessOutcome};

/// The compliant contact as it gets stiffer, beside the rigid one: the paradox resolved.
#[derive(Debug, Args)]
pub struct Options {
    /// Stiffnesses of the contact, N/m.
    #[arg(
        long,
        value_name = "GRID",
        default_value = "10000,100000,1000000,10000000"
    )]
    stiffness: Grid,
    /// Belt speeds tried for bouncing, m/s.
    #[arg(
        long,
        value_name = "GRID",
        default_value = "-0.65:-0.2:0.025",
        allow_hyphen_values = true
    )]
    v_belt: Grid,
    /// Time before bouncing is observed, s.
    #[arg(long, value_name = "SECONDS", default_value_t = 20.0, value_parser = seconds)]
    transient_s: f64,
    /// Time during which it is observed, s.
    #[arg(long, value_name = "SECONDS", default_value_t = 5.0, value_parser = seconds)]
    record_s: f64,
    #[command(flatten)]
    base: BaseOptions,
}

impl StudyOptions for Options {
    const NAME: &'static str = "stiffness";
    const IN_SHARDS: Option<InShards<Self::Study>> = Some(in_shards);
    type Study = Stiffness;
    type Outcome = StiffnessOutcome;

    fn study(&self) -> Result<Stiffness, StudyError> {
        let scenario = self.base.load(
            &[("contact", "--stiffness")],
            &["arm", "belt", "impact", "solver"],
        )?;
        let speed_m_s = scenario.belt.profile.speed_m_s(0.0);
        range::check("belt.profile.speed_m_s", speed_m_s, -100.0, 0.0)?;
        for &v_belt_m_s in self.v_belt.values() {
            range::check("--v-belt", v_belt_m_s, -100.0, 100.0)?;
        }
        let study = Stiffness {
            parameters: scenario.plant_parameters(),
            stiffnesses_n_m: self.stiffness.values().to_vec(),
            v_belt: self.v_belt.clone(),
            transient_s: self.transient_s,
            record_s: self.record_s,
        };
        for &stiffness_n_m in self.stiffness.values() {
            study.contact(stiffness_n_m, study.sticking_mass_kg()?)?;
        }
        Ok(study)
    }

    fn outcome(_: &Stiffness, rows: Vec<Row>) -> StiffnessOutcome {
        StiffnessOutcome { rows }
    }
}

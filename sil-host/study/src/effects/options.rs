//! Options of the study of effects.

use clap::Args;
use clap::builder::PossibleValuesParser;

use super::{Contact, EFFECTS, EffectsOutcome, EffectsStudy, Row, find};
use crate::StudyError;
use crate::case::{ControllerChoice, own_scenarios};
use crate::catalogue::{StudyOptions, in_shards};
use crate::options::{self, Overrides};
use crate::tabular::Table;

/// Success against the level of each effect of a real rig, on rigid and on compliant contact.
#[derive(Debug, Args)]
pub struct Options {
    /// Controllers: hybrid, hybrid-paper, hybrid-paper-model, pid, a built-in scenario or a TOML file.
    #[arg(
        long,
        value_name = "NAMES",
        value_delimiter = ',',
        default_value = "hybrid"
    )]
    controller: Vec<ControllerChoice>,
    /// Contacts.
    #[arg(
        long,
        value_name = "CONTACTS",
        value_enum,
        value_delimiter = ',',
        default_value = "rigid,compliant"
    )]
    contact: Vec<Contact>,
    /// Effects, after the runs without any; all effects by default.
    #[arg(
        long,
        value_name = "EFFECTS",
        value_delimiter = ',',
        value_parser = PossibleValuesParser::new(EFFECTS.iter().map(|effect| effect.name)),
    )]
    effect: Vec<String>,
    /// Seed of all runs.
    #[arg(long, default_value_t = 1, allow_negative_numbers = true)]
    seed: u64,
    /// Runs of each level.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 100,
        value_parser = options::runs,
        allow_negative_numbers = true
    )]
    runs: usize,
    #[command(flatten)]
    overrides: Overrides,
}

impl StudyOptions for Options {
    const NAME: &'static str = "effects";
    const HAS_SHARDS: bool = true;
    type Study = EffectsStudy;
    type Outcome = EffectsOutcome;

    fn study(&self) -> Result<EffectsStudy, StudyError> {
        let none = EFFECTS[0].name;
        let mut effects = vec![none];
        if self.effect.is_empty() {
            effects.extend(EFFECTS[1..].iter().map(|effect| effect.name));
        } else {
            let chosen = self.effect.iter().filter_map(|name| find(name));
            effects.extend(
                chosen
                    .map(|effect| effect.name)
                    .filter(|name| *name != none),
            );
        }
        let study = EffectsStudy {
            controllers: self.controller.clone(),
            contacts: self.contact.clone(),
            effects,
            seed: self.seed,
            runs: self.runs,
            overrides: self.overrides.overrides.clone(),
        };
        study.check()?;
        Ok(study)
    }

    fn outcome(study: &EffectsStudy, rows: Vec<Row>) -> EffectsOutcome {
        EffectsOutcome::new(study, rows)
    }

    fn table(study: EffectsStudy) -> Option<Box<dyn Table>> {
        in_shards(study)
    }

    fn scenarios(&self) -> Vec<String> {
        let own = own_scenarios(&self.controller);
        own.into_iter().map(Into::into).collect()
    }
}

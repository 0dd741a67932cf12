//! Options of the study of effects.

use clap::Args;
use clap::builder::PossibleValuesParser;
use painleve_study_core::StudyError;
use painleve_study_core::catalogue::{InShards, StudyOptions, in_shards};
use painleve_study_core::grid::once;
use painleve_study_core::options::{ControllerOptions, RandomRuns, level};

use super::{Contact, EFFECTS, EffectsOutcome, EffectsStudy, FIXED, Row, find};
use crate::robustness::Criterion;

/// How often the tip is kept, and where it ends, against the level of each effect of a real rig.
#[derive(Debug, Args)]
#[command(mut_arg("runs", |runs| runs.default_value("100").help("Number of runs of each level")))]
pub struct Options {
    #[command(flatten)]
    controllers: ControllerOptions,
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
    /// Levels of the one chosen effect, in its unit, in place of its own levels.
    #[arg(
        long,
        value_name = "LEVELS",
        value_delimiter = ',',
        value_parser = level,
        requires = "effect"
    )]
    level: Vec<f64>,
    /// What counts as a success: the tip was kept on the belt without a fault, or is also in place at the end.
    #[arg(long, value_enum, default_value_t)]
    criterion: Criterion,
    #[command(flatten)]
    runs: RandomRuns,
}

impl StudyOptions for Options {
    const NAME: &'static str = "effects";
    const IN_SHARDS: Option<InShards<Self::Study>> = Some(in_shards);
    type Study = EffectsStudy;
    type Outcome = EffectsOutcome;

    fn study(&self) -> Result<EffectsStudy, StudyError> {
        let set = &self.runs.set;
        set.refuse(&[("contact.kind", "--contact")])?;
        set.refuse_fixed(&FIXED)?;
        let mut effects = vec![EFFECTS[0].name];
        if self.effect.is_empty() {
            effects.extend(EFFECTS[1..].iter().map(|effect| effect.name));
        } else {
            let chosen = self.effect.iter().filter_map(|name| find(name));
            for effect in chosen {
                if !self.contact.iter().any(|contact| effect.acts_on(*contact)) {
                    return Err(StudyError::Taken {
                        key: format!("--effect {}", effect.name),
                        instead: "use --contact compliant".into(),
                    });
                }
                effects.push(effect.name);
            }
        }
        let effects = once(&effects);
        if !self.level.is_empty() && effects.len() != 2 {
            return Err(StudyError::LevelsOfSeveralEffects);
        }
        let study = EffectsStudy {
            controllers: once(&self.controllers.controller),
            contacts: once(&self.contact),
            effects,
            levels: once(&self.level),
            seed: self.runs.seed,
            criterion: self.criterion,
            runs: self.runs.runs,
            overrides: self.runs.overrides(),
        };
        study.check()?;
        Ok(study)
    }

    fn outcome(study: &EffectsStudy, rows: Vec<Row>) -> EffectsOutcome {
        EffectsOutcome::new(study, rows)
    }
}

//! `painleve study robustness` and `painleve study ablation`: the campaign, whole and in parts.

use clap::Args;
use painleve_study::StudyError;
use painleve_study::robustness::{Ablation, AblationStudy, Arms, Campaign, Part, Robustness};

use super::options::{self, OutcomeOptions, Overrides};
use crate::CommandError;

/// Options of `painleve study robustness`.
#[derive(Debug, Args)]
pub struct RobustnessArguments {
    /// The paper's arm with errors, or any arm, which the controller is told.
    #[arg(long, value_enum, default_value = "paper")]
    arms: Arms,
    /// Seed of all runs.
    #[arg(long, default_value_t = 1, allow_negative_numbers = true)]
    seed: u64,
    /// Number of runs.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 10000,
        value_parser = options::runs,
        allow_negative_numbers = true
    )]
    runs: usize,
    /// Parts of the controller that are switched off.
    #[arg(long, value_name = "PARTS", value_enum, value_delimiter = ',')]
    without: Vec<Part>,
    #[command(flatten)]
    overrides: Overrides,
    #[command(flatten)]
    outcome: OutcomeOptions,
}

/// Options of `painleve study ablation`.
#[derive(Debug, Args)]
pub struct AblationArguments {
    /// The paper's arm with errors, or any arm, which the controller is told.
    #[arg(long, value_enum, default_value = "paper")]
    arms: Arms,
    /// Seed of all runs.
    #[arg(long, default_value_t = 1, allow_negative_numbers = true)]
    seed: u64,
    /// Number of runs with each part switched off.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 500,
        value_parser = options::runs,
        allow_negative_numbers = true
    )]
    runs: usize,
    /// Parts to switch off, one at a time; all by default.
    #[arg(long, value_name = "PARTS", value_enum, value_delimiter = ',')]
    without: Vec<Part>,
    #[command(flatten)]
    overrides: Overrides,
    #[command(flatten)]
    outcome: OutcomeOptions,
}

impl RobustnessArguments {
    /// The campaign that is asked for, checked.
    ///
    /// # Errors
    /// [`StudyError`] naming the key that is wrong.
    pub fn study(&self) -> Result<Robustness, StudyError> {
        let parts = self.without.iter().flat_map(|part| part.without());
        let mut overrides: Vec<String> = parts.map(ToString::to_string).collect();
        overrides.extend(self.overrides.overrides.iter().cloned());
        let study = Robustness {
            arms: self.arms,
            seed: self.seed,
            runs: self.runs,
            overrides,
        };
        study.check()?;
        Ok(study)
    }
}

/// Computes the campaign and writes it.
pub fn run(arguments: &RobustnessArguments) -> Result<(), CommandError> {
    let study = arguments.study()?;
    let rows = arguments.outcome.compute(&study)?;
    arguments
        .outcome
        .write(&Campaign::new(arguments.arms, arguments.seed, rows))
}

/// Computes the campaign without one part after the other, and writes what each contributes.
pub fn run_ablation(arguments: &AblationArguments) -> Result<(), CommandError> {
    let study = AblationStudy {
        campaign: Robustness {
            arms: arguments.arms,
            seed: arguments.seed,
            runs: arguments.runs,
            overrides: arguments.overrides.overrides.clone(),
        },
        parts: if arguments.without.is_empty() {
            Part::ALL.to_vec()
        } else {
            arguments.without.clone()
        },
    };
    study.campaign.check()?;
    let rows = arguments.outcome.compute(&study)?;
    arguments.outcome.write(&Ablation::new(&study, rows))
}

//! Options that several studies share.

use clap::{Args, ValueEnum};
use painleve_plant::scenario::Scenario;
use painleve_shared::Posture;

use crate::StudyError;

/// The built-in scenario without a controller.
const OPEN_LOOP: &str = "open-loop-bounce";

/// The scenario that an open-loop study varies.
#[derive(Clone, Debug, Args)]
pub struct BaseOptions {
    /// Built-in scenario or TOML file that provides the plant and the controller.
    #[arg(long, value_name = "SCENARIO", default_value = OPEN_LOOP)]
    scenario: String,
    #[command(flatten)]
    overrides: Overrides,
}

impl BaseOptions {
    /// Name of the scenario.
    pub fn name(&self) -> &str {
        &self.scenario
    }

    /// Returns the scenario with its numbers checked, but not its initial state. `taken` lists
    /// the keys that the study's own options set, with the option of each.
    ///
    /// # Errors
    /// [`StudyError`] if the scenario is invalid, or if it sets a key in `taken`.
    pub fn load(&self, taken: &[(&str, &str)]) -> Result<Scenario, StudyError> {
        self.overrides.refuse(taken)?;
        Ok(Scenario::load_unplaced(
            &self.scenario,
            &self.overrides.overrides,
        )?)
    }
}

/// Changes to every scenario of a study.
#[derive(Clone, Debug, Args)]
pub struct Overrides {
    /// Override one key of the plant or the controller, for example arm.height_m=0.36; may be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub overrides: Vec<String>,
}

impl Overrides {
    /// Rejects overrides of keys that the study's own options set.
    ///
    /// # Errors
    /// [`StudyError::Option`] naming the option to use instead.
    pub fn refuse(&self, taken: &[(&str, &str)]) -> Result<(), StudyError> {
        for text in &self.overrides {
            let key = text.split('=').next().unwrap_or_default().trim();
            let inside = |taken: &str| {
                key == taken
                    || key
                        .strip_prefix(taken)
                        .is_some_and(|rest| rest.starts_with('.'))
            };
            if let Some((_, option)) = taken.iter().find(|(taken, _)| inside(taken)) {
                return Err(StudyError::Option(format!(
                    "--set {key} has no effect here; use {option}"
                )));
            }
        }
        Ok(())
    }
}

/// A posture on the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum PostureOption {
    /// θ2 > θ1.
    ElbowUp,
    /// θ2 < θ1.
    ElbowDown,
}

impl From<PostureOption> for Posture {
    fn from(option: PostureOption) -> Self {
        match option {
            PostureOption::ElbowUp => Self::ElbowUp,
            PostureOption::ElbowDown => Self::ElbowDown,
        }
    }
}

/// A length on the command line.
pub fn metres(text: &str) -> Result<f64, String> {
    positive(text, 1e-6, 1.0, "metres")
}

/// A duration on the command line.
pub fn seconds(text: &str) -> Result<f64, String> {
    positive(text, 1e-3, 1e6, "seconds")
}

/// A number of runs on the command line.
pub fn runs(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(runs @ 1..=10_000_000) => Ok(runs),
        _ => Err("the number of runs must be from 1 to 10000000".into()),
    }
}

fn positive(text: &str, least: f64, most: f64, unit: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (least..=most).contains(&value) => Ok(value),
        _ => Err(format!("give {unit} from {least} to {most}")),
    }
}

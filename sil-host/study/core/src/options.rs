//! Options that several studies share.
//!
//! A study flattens them into its own options; where its default or help differs, it changes the
//! argument with `mut_arg`.

use std::fmt::Display;
use std::ops::RangeInclusive;
use std::str::FromStr;

use clap::{Args, ValueEnum};
use painleve_plant::mechanics::compliant::ContactKind;
use painleve_plant::scenario::{self, Scenario};
use painleve_shared::Posture;

use crate::case::{ControllerChoice, ConverterChoice};
use crate::grid::once;
use crate::initial::Initials;
use crate::{Grid, StudyError};

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
    /// Returns the scenario with its numbers checked, but not its initial state. `taken` lists
    /// the keys that the study's own options set, with the option of each; `used` the tables that the study uses.
    ///
    /// # Errors
    /// [`StudyError`] if the scenario is invalid, if an override sets a key in `taken` or outside the tables in `used`, or
    /// if the scenario has an effect: studies that start from it alone compute the arm without.
    pub fn load(&self, taken: &[(&str, &str)], used: &[&str]) -> Result<Scenario, StudyError> {
        self.overrides.refuse(taken)?;
        let scenario = Scenario::load_unplaced(&self.scenario, &self.overrides.overrides)?;
        if let Some(key) = scenario.effects.first_on(&scenario.arm) {
            return Err(self.ignored(key));
        }
        match scenario::first_outside(&self.overrides.overrides, used) {
            Some(key) => Err(StudyError::Taken {
                key: key.to_owned(),
                instead: format!("set keys of {}", used.join(", ")),
            }),
            None => Ok(scenario),
        }
    }

    /// Returns the scenario like [`load`](Self::load), for a study that computes the arm on a rigid contact.
    ///
    /// # Errors
    /// As [`load`](Self::load), and [`StudyError::Ignored`] if the contact is compliant.
    pub fn load_rigid(
        &self,
        taken: &[(&str, &str)],
        used: &[&str],
    ) -> Result<Scenario, StudyError> {
        let scenario = self.load(taken, used)?;
        match scenario.contact.kind {
            ContactKind::Rigid => Ok(scenario),
            ContactKind::Compliant => Err(self.ignored("contact.kind = \"compliant\"")),
        }
    }

    fn ignored(&self, setting: &'static str) -> StudyError {
        StudyError::Ignored {
            scenario: self.scenario.clone(),
            setting,
        }
    }
}

/// Changes to every scenario of a study.
#[derive(Clone, Debug, Args)]
pub struct Overrides {
    /// Override one key of the plant or the controller, for example arm.tip_mass_kg=0.02; may be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub overrides: Vec<String>,
}

impl Overrides {
    /// Rejects overrides of keys that the study's own options set.
    ///
    /// # Errors
    /// [`StudyError::Taken`] naming the option to use instead.
    pub fn refuse(&self, taken: &[(&str, &str)]) -> Result<(), StudyError> {
        let mut taken = taken.iter();
        taken.try_for_each(|(key, option)| self.refuse_key(key, &format!("use {option}")))
    }

    /// Rejects overrides of the law, which has an effect but would leave the controllers with other laws than their names
    /// say.
    ///
    /// # Errors
    /// [`StudyError::Law`] naming the key.
    pub fn refuse_law(&self) -> Result<(), StudyError> {
        match self.first_that_sets("controller.law") {
            Some(key) => Err(StudyError::Law { key: key.into() }),
            None => Ok(()),
        }
    }

    /// Rejects overrides of keys that the study sets in every run.
    ///
    /// # Errors
    /// [`StudyError::Taken`] naming the key.
    pub fn refuse_fixed(&self, keys: &[&str]) -> Result<(), StudyError> {
        let mut keys = keys.iter();
        keys.try_for_each(|key| self.refuse_key(key, "the study sets it"))
    }

    fn refuse_key(&self, taken: &str, instead: &str) -> Result<(), StudyError> {
        match self.first_that_sets(taken) {
            Some(key) => Err(StudyError::Taken {
                key: key.to_owned(),
                instead: instead.to_owned(),
            }),
            None => Ok(()),
        }
    }

    fn first_that_sets<'a>(&'a self, taken: &'a str) -> Option<&'a str> {
        let mut overrides = self.overrides.iter();
        overrides.find_map(|text| scenario::sets(text, taken))
    }
}

/// Runs drawn at random.
#[derive(Clone, Debug, Args)]
pub struct RandomRuns {
    /// Seed of all runs.
    #[arg(long, default_value_t = 1, value_parser = seed)]
    pub seed: u64,
    /// Number of runs.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 1000,
        value_parser = runs
    )]
    pub runs: usize,
    /// Changes to every drawn scenario.
    #[command(flatten)]
    pub set: Overrides,
}

impl RandomRuns {
    /// Returns the changes to every drawn scenario.
    pub fn overrides(&self) -> Vec<String> {
        self.set.overrides.clone()
    }
}

/// Friction coefficients of a study.
#[derive(Clone, Debug, Args)]
pub struct FrictionGrid {
    /// Friction coefficients μ, FROM:TO:STEP or a list; the scenario's by default.
    #[arg(long, value_name = "GRID", allow_hyphen_values = true)]
    mu: Option<Grid>,
}

impl FrictionGrid {
    /// Returns the friction coefficients, by default that of the scenario.
    pub fn of(&self, scenario: &Scenario) -> Vec<f64> {
        let of_scenario = || vec![scenario.belt.friction];
        let grid = self.mu.as_ref();
        grid.map_or_else(of_scenario, |grid| grid.values().to_vec())
    }

    /// Returns the friction coefficients, by default that of all the controllers' scenarios.
    ///
    /// # Errors
    /// [`StudyError`] if a scenario cannot be loaded, or if they differ.
    pub fn of_controllers(&self, controllers: &[ControllerChoice]) -> Result<Vec<f64>, StudyError> {
        if let Some(grid) = &self.mu {
            return Ok(grid.values().to_vec());
        }
        let mut mu: Vec<f64> = Vec::new();
        for controller in controllers {
            mu.push(controller.load_unplaced()?.belt.friction);
        }
        mu.sort_by(f64::total_cmp);
        mu.dedup();
        match mu[..] {
            [_] => Ok(mu),
            _ => Err(StudyError::SeveralFrictions { mu }),
        }
    }
}

/// Belt speeds of a study.
#[derive(Clone, Debug, Args)]
pub struct BeltSpeedGrid {
    /// Belt speeds, m/s.
    #[arg(
        long,
        value_name = "GRID",
        default_value = "-1:-0.1:0.005",
        allow_hyphen_values = true
    )]
    pub v_belt: Grid,
}

/// Initial conditions of a study.
#[derive(Clone, Debug, Args)]
pub struct InitialOptions {
    /// Initial conditions: the paper's a, d and u, for an arm of another shape at the same fraction of its reach, and random
    /// ones as random:N, for example a,d,random:8.
    #[arg(long, value_name = "LIST", default_value = "a")]
    pub initial: Initials,
    /// Seed of the random initial conditions.
    #[arg(long, default_value_t = 1, value_parser = seed)]
    pub seed: u64,
}

/// How long each cell of a diagram runs.
#[derive(Clone, Debug, Args)]
pub struct RecordingOptions {
    /// Transient of each cell before recording starts, s; 250 in the paper.
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = 250.0,
        value_parser = seconds
    )]
    pub transient_s: f64,
    /// Recording time of each cell, s; 50 in the paper.
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = 50.0,
        value_parser = seconds
    )]
    pub record_s: f64,
}

/// Controllers of a closed-loop study.
#[derive(Clone, Debug, Args)]
pub struct ControllerOptions {
    /// Controllers: pid, hybrid-paper (the paper's law and gains), hybrid-paper-model (the same
    /// with known friction), hybrid (as built in), or any scenario or file.
    #[arg(
        long,
        value_name = "NAMES",
        value_delimiter = ',',
        default_value = "hybrid"
    )]
    pub controller: Vec<ControllerChoice>,
}

/// Converters of a closed-loop study.
#[derive(Clone, Debug, Args)]
pub struct ConverterOptions {
    /// Converters: ideal (as in the paper), hardware, or the scenario's own; by default own if a controller is a scenario or
    /// file, or else hardware.
    #[arg(long, value_name = "SETS", value_enum, value_delimiter = ',')]
    converters: Vec<ConverterChoice>,
}

impl ConverterOptions {
    /// Returns the converters, each once: by default those of the scenarios if a controller is one, or else `usual`.
    pub fn of(
        &self,
        controllers: &[ControllerChoice],
        usual: &[ConverterChoice],
    ) -> Vec<ConverterChoice> {
        let own = ConverterChoice::Own;
        let has_own = |controller: &ControllerChoice| controller.usual_converters() == own;
        match &self.converters[..] {
            [] if controllers.iter().any(has_own) => vec![own],
            [] => usual.to_vec(),
            given => once(given),
        }
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
///
/// # Errors
/// The allowed range, if the text is no number within it: 1 µm to 1 m.
pub fn metres(text: &str) -> Result<f64, String> {
    number(text, 1e-6..=1.0, "metres")
}

/// A duration on the command line.
///
/// # Errors
/// The allowed range, if the text is no number within it: 1 ms to 10⁶ s.
pub fn seconds(text: &str) -> Result<f64, String> {
    number(text, 1e-3..=1e6, "seconds")
}

/// A level of an effect on the command line. The range of its key is checked by the scenario.
///
/// # Errors
/// The allowed range, if the text is no finite number of at least 0.
pub fn level(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(level) if level.is_finite() && level >= 0.0 => Ok(level),
        _ => Err("a level must be a number of at least 0".into()),
    }
}

/// A seed on the command line.
///
/// # Errors
/// The allowed range, if the text is no number within it.
pub fn seed(text: &str) -> Result<u64, String> {
    number(text, 0..=u64::MAX, "a whole number")
}

/// A number of runs on the command line.
///
/// # Errors
/// The allowed range, if the text is no number within it: 1 to 10,000,000.
pub fn runs(text: &str) -> Result<usize, String> {
    number(text, 1..=10_000_000, "a number of runs")
}

/// A number on the command line.
///
/// # Errors
/// The allowed range, if the text is no number within it.
pub fn number<N: FromStr + PartialOrd + Display>(
    text: &str,
    range: RangeInclusive<N>,
    what: &str,
) -> Result<N, String> {
    let number = text.parse().ok().filter(|number| range.contains(number));
    number.ok_or_else(|| format!("give {what} from {} to {}", range.start(), range.end()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn options(overrides: &[&str]) -> BaseOptions {
        let overrides = overrides.iter().map(ToString::to_string).collect();
        BaseOptions {
            scenario: OPEN_LOOP.into(),
            overrides: Overrides { overrides },
        }
    }

    #[test]
    fn a_table_around_a_taken_key_is_refused_if_it_sets_the_key() {
        let load = |text| options(&[text]).load(&[("belt.friction", "--mu")], &["belt"]);
        for text in ["belt.friction=0.9", "belt={friction=0.9}"] {
            let message = load(text).unwrap_err().to_string();
            assert_eq!(message, "belt.friction has no effect here; use --mu");
        }
        let other = load("belt={profile={kind='constant',speed_m_s=-0.7}}").unwrap();
        assert_eq!(other.belt.profile.speed_m_s(0.0), -0.7);
    }

    #[test]
    fn friction_is_that_of_the_scenario_unless_an_option_says_another() {
        let path =
            std::env::temp_dir().join(format!("painleve-friction-{}.toml", std::process::id()));
        std::fs::write(&path, "[belt]\nfriction = 0.8\n").unwrap();
        let own = ControllerChoice::Scenario(path.to_string_lossy().into());
        let (told, default) = (
            FrictionGrid {
                mu: Some(Grid::of(0.3)),
            },
            FrictionGrid { mu: None },
        );
        let of = |grid: &FrictionGrid, controllers: &[ControllerChoice]| {
            grid.of_controllers(controllers)
                .map_err(|error| error.to_string())
        };
        let both = [ControllerChoice::Hybrid, own.clone()];
        assert_eq!(of(&default, &[own]), Ok(vec![0.8]));
        assert_eq!(of(&default, &ControllerChoice::ALL), Ok(vec![0.6]));
        assert_eq!(of(&told, &both), Ok(vec![0.3]));
        let message = of(&default, &both).unwrap_err();
        assert!(
            message.contains("[0.6, 0.8]") && message.contains("--mu"),
            "{message}"
        );
        let scenario = Scenario::load_unplaced(&path.to_string_lossy(), &[]).unwrap();
        assert_eq!(
            (default.of(&scenario), told.of(&scenario)),
            (vec![0.8], vec![0.3])
        );
        std::fs::remove_file(path).unwrap();
    }

    #[test]
    fn what_a_study_does_not_compute_is_refused() {
        let soft = "contact.kind=compliant";
        for (overrides, named) in [
            (
                &[soft, "effects.surface.step_height_m=0.005"][..],
                "effects.surface",
            ),
            (
                &[soft, "arm.coulomb_friction_nm=[0.5,0.5]"],
                "arm.coulomb_friction_nm",
            ),
        ] {
            let message = options(overrides)
                .load(&[], &["contact"])
                .unwrap_err()
                .to_string();
            assert!(
                message.starts_with("scenario open-loop-bounce: "),
                "{message}"
            );
            assert!(message.contains(named), "{message}");
        }
        assert!(options(&[soft]).load(&[], &["contact"]).is_ok());
        assert!(options(&[]).load_rigid(&[], &[]).is_ok());
        let message = options(&[soft])
            .load_rigid(&[], &["contact"])
            .unwrap_err()
            .to_string();
        assert!(
            message.contains("contact.kind = \"compliant\" has no effect here"),
            "{message}"
        );
    }
}

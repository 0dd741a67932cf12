//! The scenario of a run, as its options select it.

use std::io::{self, Read, Write};

use clap::{Args, ValueEnum};
use painleve_files::input_file;
use painleve_link::Pacing;
use painleve_plant::scenario::{Scenario, built_in};
use painleve_study_core::outcome::quoted;
use painleve_study_quality::robustness::{self, Arms};
use serde::{Deserialize, Serialize};
use tempfile::NamedTempFile;

use super::CommandError;
use super::output_error::{InputError, OutputError};
use super::system_path::SystemPath;

/// A run of the robustness campaign.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Replay {
    seed: u64,
    index: u64,
}

impl std::str::FromStr for Replay {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        text.split_once(':')
            .and_then(|(seed, index)| {
                Some(Self {
                    seed: seed.parse().ok()?,
                    index: index.parse().ok()?,
                })
            })
            .ok_or_else(|| {
                "expected the campaign's seed and the number of the run as SEED:INDEX, for example 1:42".into()
            })
    }
}

/// The scenario and its pacing.
#[derive(Clone, Debug, Args, Serialize, Deserialize)]
pub struct ScenarioArguments {
    /// Built-in scenario or TOML file; `-` reads standard input.
    #[arg(value_name = "SCENARIO", default_value = built_in::DEFAULT)]
    name: String,
    /// Built-in scenario or TOML file, as an option instead of an argument.
    #[arg(long = "scenario", value_name = "SCENARIO", conflicts_with = "name")]
    option: Option<String>,
    /// Repeat run INDEX of `study robustness --seed SEED` instead of a scenario.
    #[arg(
        long,
        value_name = "SEED:INDEX",
        conflicts_with_all = ["name", "option"],
        allow_hyphen_values = true
    )]
    replay: Option<Replay>,
    /// With --replay: the study's option --arms; by default paper.
    #[arg(long, value_enum)]
    arms: Option<Arms>,
    /// Override one key, for example belt.friction=0.4; may be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    /// As fast as possible and deterministic, or in real time.
    #[arg(long, value_enum, default_value = "lockstep")]
    pub pacing: Pacing,
    /// The copy of standard input, once there is one.
    #[arg(skip)]
    copy: Option<SystemPath>,
}

impl ScenarioArguments {
    /// Name or path of the scenario.
    pub fn name(&self) -> &str {
        self.option.as_deref().unwrap_or(&self.name)
    }

    /// Returns the scenario with its overrides, after validation.
    ///
    /// # Errors
    /// [`CommandError`] with one sentence for the user.
    pub fn load(&self) -> Result<Scenario, CommandError> {
        let arms = [("--arms", self.arms.is_some())];
        InputError::check_needed("--replay", self.replay.is_some(), &arms)?;
        match self.replay {
            Some(Replay { seed, index }) => {
                let drawn = robustness::scenario(self.arms.unwrap_or_default(), seed, index)?;
                Ok(drawn.with_overrides("replayed run", &self.overrides)?)
            }
            None => Ok(match &self.copy {
                Some(copy) => Scenario::load_standard_input(copy, &self.overrides)?,
                None => Scenario::load(self.name(), &self.overrides)?,
            }),
        }
    }

    /// Returns the shell command that runs this scenario.
    pub fn command(&self) -> String {
        let mut command = String::from("painleve run");
        match self.replay {
            Some(Replay { seed, index }) => {
                let arms = self.arms.unwrap_or_default().to_possible_value();
                let arms = arms.as_ref().map_or("", |arms| arms.get_name());
                command += &format!(" --replay {seed}:{index} --arms {arms}");
            }
            None => command += &format!(" {}", quoted(self.name())),
        }
        command.extend(self.overrides.iter().map(|text| set_option(text)));
        command
    }

    /// Copies a scenario from standard input, if it is requested as `-`, to a file that every process
    /// of the run can read, and which lasts as long as the returned handle.
    ///
    /// # Errors
    /// If standard input or the file fails.
    pub fn copy_standard_input(&mut self) -> Result<Option<NamedTempFile>, CommandError> {
        if self.replay.is_some() || self.name() != "-" {
            return Ok(None);
        }
        let text = standard_input().map_err(InputError::StandardInput)?;
        let file = temporary_file(&text).map_err(OutputError::Temporary)?;
        self.copy = Some(file.path().as_os_str().to_owned().into());
        Ok(Some(file))
    }
}

fn standard_input() -> io::Result<Vec<u8>> {
    input_file::remember_standard_input()?;
    let mut text = Vec::new();
    // As much as of a file, so that an endless input is refused as one.
    let input = io::stdin().lock().take(input_file::MOST_BYTES + 1);
    { input }.read_to_end(&mut text)?;
    Ok(text)
}

fn temporary_file(text: &[u8]) -> io::Result<NamedTempFile> {
    let mut file = tempfile::Builder::new()
        .prefix("painleve-standard-input-")
        .suffix(".toml")
        .tempfile()?;
    file.write_all(text)?;
    Ok(file)
}

/// Returns the option that overrides a key, for a shell, on a line of its own.
pub fn set_option(text: &str) -> String {
    format!(" \\\n    --set {}", quoted(text))
}

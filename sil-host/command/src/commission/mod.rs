//! `painleve commission`: measures how the parts of an arm are mounted, and writes its corrected scenario.

use std::path::PathBuf;

use clap::Args;
use painleve_commission::simulated::{BuiltInMistake, SimulatedError, SimulatedRig};
use painleve_commission::{
    CommissionError, Commissioned, Expected, Instruction, RawReadings, Rig, commission,
};
use painleve_plant::scenario::{Scenario, ScenarioError, built_in};
use painleve_shared::counts::TorqueCounts;
use painleve_shared::range::OutOfRange;
use painleve_system::atomic_file;
use painleve_system::terminal::warn;

use super::output_error::output;
use super::{CommandError, say};

/// Options of `painleve commission`.
#[derive(Debug, Args)]
pub struct CommissionArguments {
    /// Built-in scenario or TOML file with the arm's configuration.
    #[arg(value_name = "SCENARIO", default_value = built_in::DEFAULT)]
    scenario: String,
    /// Override one key, for example converters.force.bits=13; may be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    /// Rehearse on a simulated arm, with a simulated operator.
    #[arg(long, required = true)]
    rehearse: bool,
    /// Mistake of the simulated arm.
    #[arg(long, value_name = "MISTAKE", value_parser = mistakes())]
    mistake: Option<String>,
    /// Seed of the simulated operator's hands and of the noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Largest torque on either joint, N·m; by default, a fifth of the torque stages' range.
    #[arg(long, value_name = "N·m")]
    torque_limit_nm: Option<f64>,
    /// File for the corrected scenario.
    #[arg(long, value_name = "PATH", default_value = "out/commissioned.toml")]
    output: PathBuf,
}

/// Share of the stages' range that commissioning uses by default.
const DEFAULT_SHARE: f64 = 0.2;

fn mistakes() -> clap::builder::PossibleValuesParser {
    BuiltInMistake::ALL
        .iter()
        .map(|it| it.name())
        .collect::<Vec<_>>()
        .into()
}

/// Shows the operator's tasks of a rehearsal.
struct Rehearsal(SimulatedRig);

impl Rig for Rehearsal {
    type Error = SimulatedError;

    fn instruct(&mut self, instruction: Instruction) -> Result<(), SimulatedError> {
        warn(format_args!("operator: {instruction}"));
        self.0.instruct(instruction)
    }

    fn exchange(&mut self, torques: [TorqueCounts; 2]) -> Result<RawReadings, SimulatedError> {
        self.0.exchange(torques)
    }
}

/// Commissions the arm and writes its corrected scenario; after a refusal, nothing is written.
pub fn run(arguments: &CommissionArguments) -> Result<(), CommandError> {
    let scenario = Scenario::load(&arguments.scenario, &arguments.overrides)?;
    let range = |source: OutOfRange| {
        CommandError::Scenario(ScenarioError::Range {
            origin: arguments.scenario.clone(),
            source,
        })
    };
    let torque_limit_nm = torque_limit_nm(arguments, &scenario).map_err(range)?;
    let expected = Expected::new(&scenario, torque_limit_nm).map_err(range)?;
    let name = arguments.mistake.as_deref();
    let mistake = name.and_then(|name| BuiltInMistake::ALL.iter().find(|it| it.name() == name));
    let mut rig = Rehearsal(SimulatedRig::new(
        &scenario,
        mistake.copied(),
        arguments.seed,
    ));
    let commissioned = commission(&mut rig, &expected).map_err(|error| match error {
        CommissionError::Rig(error) => CommandError::Input(error.into()),
        CommissionError::Refused(mistake) => CommandError::Mounting(mistake),
        CommissionError::Range(source) => range(source),
    })?;
    let corrected = commissioned.applied_to(&scenario).map_err(range)?;
    let text = corrected.to_commented_toml();
    atomic_file::write(&arguments.output, text.as_bytes()).map_err(output)?;
    report(arguments, &commissioned)
}

/// Returns the torque limit, which the stages must reach.
fn torque_limit_nm(
    arguments: &CommissionArguments,
    scenario: &Scenario,
) -> Result<f64, OutOfRange> {
    let range_nm = scenario.converters.torque.range_nm;
    let limit_nm = arguments
        .torque_limit_nm
        .unwrap_or(DEFAULT_SHARE * range_nm);
    painleve_shared::range::check("--torque-limit-nm", limit_nm, 1e-3, range_nm)?;
    Ok(limit_nm)
}

/// Prints what was found and where the corrected scenario is.
fn report(
    arguments: &CommissionArguments,
    commissioned: &Commissioned,
) -> Result<(), CommandError> {
    for deviation in &commissioned.deviations {
        say(format_args!("corrected: {deviation}"))?;
    }
    if commissioned.deviations.is_empty() {
        say("the scenario describes how the arm is mounted")?;
    }
    match commissioned.friction {
        Some(friction) => say(format_args!(
            "friction of the tip on the belt: {friction:.2}"
        ))?,
        None => say(
            "friction of the tip on the belt: not measured; it did not slide within --torque-limit-nm",
        )?,
    }
    say(format_args!("written: {}", arguments.output.display()))
}

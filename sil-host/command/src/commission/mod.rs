//! `painleve commission`: measures how the parts of an arm are mounted, and writes its corrected scenario.

mod board_rig;
mod rehearsal;

use std::path::{Path, PathBuf};

use clap::{ArgGroup, Args};
use painleve_commission::second_sensors::{self, SecondSensors};
use painleve_commission::simulated::{BuiltInMistake, SimulatedRig};
use painleve_commission::{
    CommissionError, Commissioned, Deviation, Expected, NoSlide, commission,
};
use painleve_files::atomic_file;
use painleve_plant::decimal::as_written;
use painleve_plant::scenario::{Knowledge, Scenario, ScenarioError, built_in};
use painleve_shared::mounting::SensorParts;
use painleve_shared::range::OutOfRange;
use painleve_study_core::options::number;
use painleve_study_core::outcome::quoted;
use serde_json::json;

use self::board_rig::BoardRig;
pub use self::board_rig::BoardRigError;
use self::rehearsal::Rehearsal;
use super::drive::{check_not_rehearsed, check_overrides, check_rate};
use super::output::{default_output, warn_of_earlier};
use super::output_error::{InputError, output};
use super::{CommandError, distinct_files, say};

/// Options of `painleve commission`.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("arm").args(["port", "rehearse"]).required(true).multiple(true))]
pub struct CommissionArguments {
    /// Built-in scenario or TOML file with the arm's configuration; hybrid-elbow-down by default in a rehearsal.
    #[arg(value_name = "SCENARIO", default_value = built_in::DEFAULT, hide_default_value = true)]
    scenario: String,
    /// Override one key, for example converters.force.bits=13; may be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    /// Serial port of the board, for example /dev/ttyUSB0.
    #[arg(long, value_name = "PATH", requires = "scenario")]
    pub port: Option<PathBuf>,
    /// Commission the second sensors of each channel, after the first ones: finds their directions.
    #[arg(long)]
    second_sensors: bool,
    /// Rehearse on a simulated arm, with a simulated operator.
    #[arg(long, conflicts_with = "port")]
    rehearse: bool,
    /// With --rehearse: mistake of the simulated arm.
    #[arg(long, value_name = "MISTAKE", value_parser = mistakes())]
    mistake: Option<String>,
    /// With --rehearse: seed of the simulated operator's hands and of the noise; by default 1.
    #[arg(long, value_parser = painleve_study_core::options::seed)]
    seed: Option<u64>,
    /// Largest torque on either joint, N·m; by default, a fifth of the torque stages' range, or controller.torque_limit_nm
    /// if that is less.
    #[arg(long, value_name = "N·m", value_parser = |text: &str| number(text, 0.0..=1e4, "newton metres"))]
    torque_limit_nm: Option<f64>,
    /// File for the corrected scenario; by default out/commissioned.toml, and out/rehearsed/commissioned.toml with --rehearse.
    #[arg(long, value_name = "PATH")]
    output: Option<PathBuf>,
    /// Print one JSON object on stdout instead of the text.
    #[arg(long)]
    json: bool,
}

/// Share of the stages' range that commissioning uses by default.
const DEFAULT_SHARE: f64 = 0.2;

/// Highest control rate while commissioning, Hz: the line carries the readings of every tick.
const FASTEST_HZ: u32 = 1000;

fn mistakes() -> clap::builder::PossibleValuesParser {
    BuiltInMistake::ALL
        .iter()
        .map(|it| it.name())
        .collect::<Vec<_>>()
        .into()
}

/// Commissions the arm and writes its corrected scenario; after a refusal, nothing is written.
///
/// # Errors
/// [`CommandError`] if the arm refuses, the board or a file fails, or the user interrupts.
pub fn run(arguments: &CommissionArguments) -> Result<(), CommandError> {
    InputError::check_rehearsal(
        arguments.rehearse,
        arguments.mistake.as_ref(),
        arguments.seed,
    )?;
    let mut scenario = Scenario::load(&arguments.scenario, &arguments.overrides)?;
    let sensors = scenario.converters.mounting.sensors;
    if arguments.second_sensors && sensors == SensorParts::First {
        return Err(InputError::NoSecondSensors.into());
    }
    let tick_hz = scenario.run.tick_hz;
    check_rate(&scenario)?;
    if arguments.port.is_some() {
        check_not_rehearsed(&scenario)?;
        check_overrides(&scenario, &arguments.overrides)?;
    }
    let as_written = scenario.clone();
    if tick_hz > FASTEST_HZ {
        // At a lower rate the tracking loops have to be slower.
        let bandwidth_rad_s = &mut scenario.controller.estimator.bandwidth_rad_s;
        *bandwidth_rad_s *= FASTEST_HZ as f32 / tick_hz as f32;
        scenario.run.tick_hz = FASTEST_HZ;
    }
    if arguments.second_sensors {
        scenario = second_sensors::in_place_of_first(&scenario);
    }
    let range = |source: OutOfRange| {
        CommandError::Scenario(ScenarioError::range(&arguments.scenario, source))
    };
    let torque_limit_nm = torque_limit_nm(arguments, &scenario).map_err(range)?;
    let expected = Expected::new(&scenario, torque_limit_nm).map_err(range)?;
    let output_path = arguments.output.clone();
    let output_path =
        output_path.unwrap_or_else(|| default_output(arguments.rehearse, "commissioned"));
    distinct_files::check(&[("--output", &output_path)])?;
    let commissioned = match &arguments.port {
        None => rehearse(arguments, &scenario, &expected),
        Some(port) => on_board(port, &scenario, &expected),
    }
    .inspect_err(|_| warn_of_earlier(&[&output_path]))
    .map_err(|error| match error {
        CommissionError::Rig(error) => error,
        CommissionError::Refused(mistake) => CommandError::Mounting(mistake),
        CommissionError::Range(source) => range(source),
    })?;
    let (mut corrected, deviations) = if arguments.second_sensors {
        let found = SecondSensors::new(&commissioned, &as_written).map_err(|mistake| {
            warn_of_earlier(&[&output_path]);
            CommandError::Mounting(mistake)
        })?;
        (found.applied_to(&as_written), found.deviations)
    } else {
        let corrected = commissioned.applied_to(&as_written).map_err(range)?;
        (corrected, commissioned.deviations)
    };
    if arguments.rehearse {
        corrected.knowledge.source = Knowledge::rehearsal(arguments.seed.unwrap_or(1));
    }
    let text = corrected.to_commented_toml();
    atomic_file::write(&output_path, text.as_bytes()).map_err(output)?;
    report(arguments, &output_path, &deviations, commissioned.friction)?;
    let sensors = corrected.converters.mounting.sensors;
    if sensors == SensorParts::Both && !arguments.second_sensors && !arguments.json {
        let word = |path: &Path| quoted(&path.display().to_string());
        let rig = match &arguments.port {
            Some(port) => format!("--port {}", word(port)),
            None => "--rehearse".to_owned(),
        };
        say(format_args!(
            "next, commission the second sensors: painleve commission {} {rig} --second-sensors --output {}",
            word(&output_path),
            word(&output_path.with_extension("second.toml"))
        ))?;
    }
    Ok(())
}

type Outcome = Result<Commissioned, CommissionError<CommandError>>;

fn rehearse(arguments: &CommissionArguments, scenario: &Scenario, expected: &Expected) -> Outcome {
    let name = arguments.mistake.as_deref();
    let mistake = name.and_then(|name| BuiltInMistake::ALL.iter().find(|it| it.name() == name));
    let simulated = SimulatedRig::new(scenario, mistake.copied(), arguments.seed.unwrap_or(1));
    commission(&mut Rehearsal(simulated), expected)
        .map_err(|error| error.map_rig(|error| CommandError::Input(error.into())))
}

/// Commissions the arm behind a board; whatever ends it, the torque is off.
fn on_board(port: &Path, scenario: &Scenario, expected: &Expected) -> Outcome {
    let rig = BoardRig::open(port, scenario, expected.torque_limit_nm);
    let mut rig = rig.map_err(CommissionError::Rig)?;
    let outcome = commission(&mut rig, expected);
    let stopped = rig.stop();
    let commissioned = outcome.map_err(|error| error.map_rig(CommandError::from))?;
    stopped.map_err(|error| CommissionError::Rig(error.into()))?;
    Ok(commissioned)
}

/// Returns the torque limit, which the stages must reach.
fn torque_limit_nm(
    arguments: &CommissionArguments,
    scenario: &Scenario,
) -> Result<f64, OutOfRange> {
    let range_nm = scenario.converters.torque.range_nm;
    let limit_nm = arguments.torque_limit_nm.unwrap_or_else(|| {
        let own_nm = as_written(scenario.controller.torque_limit_nm);
        (DEFAULT_SHARE * range_nm).min(own_nm)
    });
    painleve_shared::range::check("--torque-limit-nm", limit_nm, 1e-3, range_nm)?;
    Ok(limit_nm)
}

/// Prints what was found and where the corrected scenario is.
fn report(
    arguments: &CommissionArguments,
    output_path: &Path,
    deviations: &[Deviation],
    friction: Result<f64, NoSlide>,
) -> Result<(), CommandError> {
    // The file of second sensors keeps the friction that the first ones have shown.
    let writes_friction = !arguments.second_sensors;
    if arguments.json {
        let corrections = deviations.iter().map(ToString::to_string);
        let mut object = json!({
            "corrections": corrections.collect::<Vec<_>>(),
            "output": output_path.display().to_string(),
        });
        if writes_friction {
            object["friction"] = friction.ok().into();
        }
        return say(object);
    }
    for deviation in deviations {
        say(format_args!("corrected: {deviation}"))?;
    }
    if deviations.is_empty() {
        say("the scenario describes how the arm is mounted")?;
    }
    match friction {
        _ if !writes_friction => {}
        Ok(friction) => say(format_args!(
            "friction of the tip on the belt: {friction:.2}"
        ))?,
        Err(reason) => say(format_args!(
            "friction of the tip on the belt: not measured; {reason}"
        ))?,
    }
    say(format_args!("written: {}", output_path.display()))
}

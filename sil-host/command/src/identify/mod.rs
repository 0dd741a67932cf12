//! `painleve identify`: measures an arm's geometry and joints by slides of its tip along the belt, and writes its scenario with the
//! values and how well they are known.

mod board_slides;
mod recorded;
mod report;
mod residuals;

use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use clap::{ArgGroup, Args};
use painleve_commission::identification::{
    Found, IdentificationError, identify_arm, identify_slides, is_new, prior,
};
use painleve_commission::set_down::{SetDown, advice};
use painleve_commission::simulated::{GeometryMistake, SimulatedSlides, imperfect};
use painleve_files::atomic_file::{commit_all, prepare};
use painleve_identify::parameters::{Drawn, JOINT_NAMES};
use painleve_identify::{Parameters, Slide};
use painleve_plant::decimal::as_written;
use painleve_plant::scenario::{Knowledge, Scenario, ScenarioError, built_in};
use painleve_process::terminal::{self, warn};
use painleve_shared::Posture;
use painleve_study_core::options::number;
use serde_json::json;

use self::board_slides::BoardSlides;
use self::recorded::Recorded;
use super::drive::{check_not_rehearsed, check_overrides, check_rate};
use super::output::{default_output, warn_of_earlier};
use super::output_error::{InputError, output};
use super::{CommandError, distinct_files, say};

/// Standard deviation of a length that has been measured with a calliper, m.
const MEASURED_M: f64 = 1e-4;

/// Lengths that a scenario's `arm.link_length_m` may have, m.
const LINK_LENGTH_M: RangeInclusive<f64> = 0.01..=10.0;

/// Standard deviations by which a value differs from another one if this is no chance.
const TOLERANCE: f64 = 3.0;

/// A later distance from the line beyond this multiple of the one written down shows that the arm has changed.
const CHANGED: f64 = 2.0;

/// Options of `painleve identify`.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("arm").args(["port", "rehearse", "slide"]).required(true).multiple(true))]
pub struct IdentifyArguments {
    /// Built-in scenario or TOML file with the arm's configuration; hybrid-elbow-down by default in a rehearsal.
    #[arg(value_name = "SCENARIO", default_value = built_in::DEFAULT, hide_default_value = true)]
    scenario: String,
    /// Override one key, for example converters.force.bits=13; may be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    /// Serial port of the board, for example /dev/ttyUSB0.
    #[arg(long, value_name = "PATH", requires = "scenario")]
    pub port: Option<PathBuf>,
    /// Rehearse on a simulated arm with random errors that the scenario does not know.
    #[arg(long, conflicts_with_all = ["port", "slide"])]
    rehearse: bool,
    /// A recorded slide: its posture and an MCAP or CSV file, for example elbow-up=slide.mcap; may be repeated.
    #[arg(long, value_name = "POSTURE=PATH", conflicts_with = "port")]
    slide: Vec<Recorded>,
    /// With --rehearse: mistake of the simulated arm.
    #[arg(long, value_name = "MISTAKE", value_parser = mistakes())]
    mistake: Option<String>,
    /// With --rehearse: seed of the simulated arm's errors; by default 1.
    #[arg(long, value_parser = painleve_study_core::options::seed)]
    seed: Option<u64>,
    /// Length of link 1 from joint to joint, measured to a tenth of a millimetre, m; by default that of the scenario, to
    /// 0.6 %. A line has no scale: positions are as exact as this length.
    #[arg(long, value_name = "M", value_parser = link_length_m)]
    link_1_m: Option<f64>,
    /// File for the scenario with the measured values; by default out/identified.toml, and out/rehearsed/identified.toml with
    /// --rehearse.
    #[arg(long, value_name = "PATH")]
    output: Option<PathBuf>,
    /// Report page, with the tip's distances from the line before and after; by default beside the scenario, with the
    /// extension html.
    #[arg(long, value_name = "PATH")]
    html: Option<PathBuf>,
    /// Print one JSON object on stdout instead of the text.
    #[arg(long)]
    json: bool,
}

/// Reads the length of a link, within the limits of a scenario's.
fn link_length_m(text: &str) -> Result<f64, String> {
    number(text, LINK_LENGTH_M, "metres")
}

fn mistakes() -> clap::builder::PossibleValuesParser {
    let names = GeometryMistake::ALL.iter().map(|it| it.name());
    names.collect::<Vec<_>>().into()
}

/// Identifies the arm and writes its scenario; after a refusal, nothing is written.
///
/// # Errors
/// [`CommandError`] if the slides give no result, the board or a file fails, or the user interrupts.
pub fn run(arguments: &IdentifyArguments) -> Result<(), CommandError> {
    InputError::check_rehearsal(
        arguments.rehearse,
        arguments.mistake.as_ref(),
        arguments.seed,
    )?;
    let mut scenario = Scenario::load(&arguments.scenario, &arguments.overrides)?;
    let recorded: Result<Vec<_>, _> = arguments
        .slide
        .iter()
        .map(|it| it.read(&scenario))
        .collect();
    let slides = recorded?;
    recorded::check_distinct(&arguments.slide, &slides)?;
    let output_path = arguments.output.clone();
    let output_path =
        output_path.unwrap_or_else(|| default_output(arguments.rehearse, "identified"));
    let html_path = arguments.html.clone();
    let html_path = html_path.unwrap_or_else(|| output_path.with_extension("html"));
    distinct_files::check(&[("--output", &output_path), ("--html", &html_path)])?;
    let mut drawn = Drawn::default();
    let written = prior(&scenario, &drawn).parameters;
    if let Some(length_m) = arguments.link_1_m {
        let mut arm = scenario.controller_configuration().arm;
        warn_of_length(length_m, as_written(arm.link_length_m[0]), drawn.length);
        arm.link_length_m[0] = length_m as f32;
        scenario.arm_model = Some(arm);
        drawn.length = MEASURED_M / length_m;
    }
    let warn_of_earlier = |_: &CommandError| warn_of_earlier(&[&output_path, &html_path]);
    let found = found(arguments, &slides, &scenario, &drawn);
    let (found, source) = found.inspect_err(warn_of_earlier)?;
    let changes = changes(&scenario, &written, &found);
    for change in &changes {
        warn(change);
    }
    let identified = found.applied_to(&scenario, &source);
    let identified = identified
        .map_err(CommandError::Geometry)
        .inspect_err(warn_of_earlier)?;
    let text = identified.to_commented_toml();
    let place = advice(&identified).map_err(|error| range(&arguments.scenario, error))?;
    let page = report::html(&identified.name, &found, &changes, &place);
    commit_all(vec![
        prepare(&output_path, text.as_bytes()).map_err(output)?,
        prepare(&html_path, page.as_bytes()).map_err(output)?,
    ])
    .map_err(output)?;
    let written = [output_path, html_path].map(|path| path.display().to_string());
    report(arguments, &found, &changes, &identified, &place, &written)
}

/// Warns if a measured length differs from that of the scenario by more than a drawing's tolerance explains: all positions
/// are as wrong as this length.
fn warn_of_length(measured_m: f64, drawn_m: f64, deviation: f64) {
    if (measured_m / drawn_m - 1.0).abs() > TOLERANCE * deviation {
        warn(format_args!(
            "--link-1-m is {measured_m} m, but the scenario says {drawn_m} m: measure link 1 again, from joint to joint"
        ));
    }
}

/// Returns the result and where it comes from.
fn found(
    arguments: &IdentifyArguments,
    slides: &[Slide],
    scenario: &Scenario,
    drawn: &Drawn,
) -> Result<(Found, String), CommandError> {
    let name = &arguments.scenario;
    if !slides.is_empty() {
        let found = identify_slides(slides, scenario, drawn)
            .map_err(|error| failed(name, error, |never| match never {}))?;
        let source = format!("{} recorded slides", slides.len());
        let is_simulated =
            scenario.knowledge.is_rehearsed() || arguments.slide.iter().any(Recorded::is_simulated);
        let source = if is_simulated {
            Knowledge::of_simulation(&source)
        } else {
            source
        };
        return Ok((found, source));
    }
    // A rehearsal shows what the board would refuse.
    check_rate(scenario)?;
    if let Some(port) = &arguments.port {
        check_not_rehearsed(scenario)?;
        check_overrides(scenario, &arguments.overrides)?;
        if is_new(scenario) {
            return Err(InputError::NotCommissioned.into());
        }
        let found = on_board(port, scenario, drawn);
        let found = found.map_err(|error| failed(name, error, CommandError::from))?;
        return Ok((found, format!("slides of the arm at {}", port.display())));
    }
    let mistake = arguments.mistake.as_deref();
    let mistake = mistake.and_then(|name| GeometryMistake::ALL.iter().find(|it| it.name() == name));
    let seed = arguments.seed.unwrap_or(1);
    let actual = imperfect(scenario, seed).map_err(|error| range(name, error))?;
    let mut rig = SimulatedSlides::new(actual, mistake.copied());
    let found = identify_arm(&mut rig, scenario, drawn)
        .map_err(|error| failed(name, error, |error| CommandError::Input(error.into())))?;
    Ok((found, Knowledge::rehearsal(seed)))
}

/// Identifies the arm behind a board; whatever ends it, the torque is off.
fn on_board(
    port: &Path,
    scenario: &Scenario,
    drawn: &Drawn,
) -> Result<Found, IdentificationError<crate::commission::BoardRigError>> {
    let mut rig = BoardSlides::new(port).map_err(IdentificationError::Rig)?;
    identify_arm(&mut rig, scenario, drawn)
}

fn range(name: &str, source: painleve_shared::OutOfRange) -> CommandError {
    CommandError::Scenario(ScenarioError::range(name, source))
}

/// Returns the command's error for one of the identification.
fn failed<E: std::error::Error>(
    name: &str,
    error: IdentificationError<E>,
    of_rig: impl FnOnce(E) -> CommandError,
) -> CommandError {
    match error {
        IdentificationError::Rig(error) => of_rig(error),
        IdentificationError::Refused(refusal) => CommandError::Geometry(refusal),
        IdentificationError::Scenario(error) => CommandError::Scenario(error),
        IdentificationError::Range(error) => range(name, error),
    }
}

/// Returns in what an arm that has been identified before is no longer as `written` in its scenario. A length that was measured
/// since is no change of the arm.
fn changes(scenario: &Scenario, written: &Parameters, found: &Found) -> Vec<String> {
    let knowledge = &scenario.knowledge;
    let mut changes = Vec::new();
    let written_m = knowledge.off_line_m;
    let now_m = found.identified.points.off_line_m(written);
    if written_m > 0.0 && now_m > CHANGED * written_m {
        changes.push(format!(
            "the arm has changed: by the scenario's values the tip is {:.2} mm off the line, where {:.2} mm were left when \
             they were measured ({})",
            1e3 * now_m,
            1e3 * written_m,
            knowledge.source
        ));
    }
    let arm = scenario.controller_configuration().arm;
    for (joint, name) in JOINT_NAMES.iter().enumerate() {
        let now = &found.joints.joints[joint];
        for (what, unit, before, deviation, now) in [
            (
                "friction",
                "N·m",
                arm.coulomb_friction_nm[joint],
                knowledge.coulomb_friction_nm[joint],
                now.friction_nm,
            ),
            (
                "spring",
                "N·m/rad",
                arm.stiffness_nm_rad[joint],
                knowledge.stiffness_nm_rad[joint],
                now.stiffness_nm_rad,
            ),
        ] {
            let change = now.value - as_written(before);
            // What has never been measured has no deviation.
            if deviation > 0.0 && change.abs() > TOLERANCE * deviation.hypot(now.deviation) {
                changes.push(format!(
                    "the {what} of {name} has changed from {before:.3} ± {deviation:.3} to {:.3} ± {:.3} {unit}",
                    now.value, now.deviation
                ));
            }
        }
    }
    changes
}

/// Prints what was found and has changed, where it is written, and the `place` where the identified arm may be set down.
fn report(
    arguments: &IdentifyArguments,
    found: &Found,
    changes: &[String],
    identified: &Scenario,
    place: &str,
    [output, html]: &[String; 2],
) -> Result<(), CommandError> {
    if arguments.json {
        let mut object = report::json(found);
        object["changes"] = changes.into();
        object["output"] = output.as_str().into();
        object["html"] = html.as_str().into();
        for (key, posture) in [
            ("elbow_down", Posture::ElbowDown),
            ("elbow_up", Posture::ElbowUp),
        ] {
            let SetDown { best_m, stretch_m } = SetDown::of(identified, posture)
                .map_err(|error| range(&arguments.scenario, error))?;
            let stretch_m = stretch_m.map(|it| [it.start, it.end]);
            object["set_down"][key] = json!({ "best_m": best_m, "stretch_m": stretch_m });
        }
        return say(object);
    }
    say(report::text(found))?;
    say(terminal::readable(place))?;
    say(format_args!("written: {output} and {html}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use painleve_shared::ArmParameters;
    use painleve_shared::settings::Settings;

    #[test]
    fn a_link_may_be_as_long_as_in_a_scenario() {
        let mut settings = ArmParameters::<f64>::FIELDS.iter();
        let range = settings
            .find(|field| field.key == "link_length_m")
            .unwrap()
            .range
            .unwrap();
        assert_eq!(range.minimum..=range.maximum, LINK_LENGTH_M);
        assert_eq!(link_length_m("9"), Ok(9.0));
        assert_eq!(
            link_length_m("0.001").unwrap_err(),
            "give metres from 0.01 to 10"
        );
    }
}

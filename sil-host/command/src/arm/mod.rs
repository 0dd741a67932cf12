//! `painleve arm`: reads a planar two-link arm from a URDF or an MJCF file, and prints it as a scenario.

mod chain;
mod mjcf;
mod planar;
mod shape;
#[cfg(test)]
mod tests;
mod urdf;

use std::path::{Path, PathBuf};

use clap::Args;
use painleve_files::input_file;
use painleve_plant::mechanics::compliant::{ContactKind, TipContact};
use painleve_plant::scenario::{InitialState, Scenario};
use painleve_process::terminal::warn;
use painleve_shared::ArmParameters;
use painleve_study_core::options::number;

use super::output_error::InputError;
use super::{CommandError, say};
use planar::{Imported, Tip};

/// Options of `painleve arm`.
#[derive(Debug, Args)]
pub struct ArmArguments {
    /// A URDF or an MJCF file.
    file: PathBuf,
    /// Where link 2 touches the belt: a link, body or site of the file, or x,y,z in the frame of link 2, m. Needed unless
    /// link 2 has exactly one frame at its end.
    #[arg(long, value_name = "NAME|X,Y,Z", allow_hyphen_values = true)]
    tip: Option<Tip>,
    /// Distance of the first joint from the belt, m; 0.9 of the arm's reach if absent.
    #[arg(long, value_name = "M", value_parser = |text: &str| number(text, 1e-4..=20.0, "metres"))]
    height_m: Option<f64>,
}

/// Largest number of elements and texts of a file: each element is looked up among all. Real arms have hundreds.
const MOST_NODES: u32 = 10_000;

/// Share of the arm's reach that is its height above the belt if none is given: the paper's.
const HEIGHT_SHARE: f64 = 0.9;

/// Share of the arm's reach that is the place to which the tip slides: the paper's.
const TARGET_SHARE: f64 = 0.35;

/// Prints the arm as a scenario, and on standard error what of the file it lacks.
///
/// # Errors
/// [`CommandError`] if the file cannot be read or contains no planar two-link arm.
pub fn run(arguments: &ArmArguments) -> Result<(), CommandError> {
    let path = &arguments.file;
    let refused = |reason: String| InputError::Arm {
        path: path.clone(),
        reason,
    };
    let text = input_file::read(path).map_err(|error| refused(error.to_string()))?;
    let Imported { mut arm, ignored } = read(&text, arguments.tip.as_ref()).map_err(refused)?;
    let reach_m: f64 = arm.link_length_m.iter().sum();
    arm.height_m = arguments
        .height_m
        .unwrap_or_else(|| planar::rounded(HEIGHT_SHARE * reach_m));
    let scenario = scenario(path, arm)?;
    if arguments.height_m.is_none() {
        warn(format_args!(
            "the file has no belt: height_m = {} is {HEIGHT_SHARE} of the arm's reach",
            arm.height_m
        ));
    }
    if !ignored.is_empty() {
        warn(format_args!("ignored: {}", ignored.join(", ")));
    }
    say(scenario.to_brief_toml().trim_end())
}

/// Returns a scenario in which the tip of this arm slides along its belt; only a compliant contact goes with friction in the joints.
fn scenario(path: &Path, arm: ArmParameters<f64>) -> Result<Scenario, CommandError> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let kind = if arm.coulomb_friction_nm == [0.0; 2] {
        ContactKind::Rigid
    } else {
        ContactKind::Compliant
    };
    let scenario = Scenario {
        description: format!("The arm of {name}"),
        arm,
        contact: TipContact {
            kind,
            ..TipContact::default()
        },
        initial: InitialState {
            tip_m: Some(0.0),
            ..InitialState::default()
        },
        ..Scenario::default()
    };
    let target_m = planar::rounded(TARGET_SHARE * arm.link_length_m.iter().sum::<f64>());
    let slide = format!(
        "controller.reference=[{{ minimum-jerk = {{ target_m = {target_m}, duration_s = 3.0 }} }}]"
    );
    Ok(scenario.with_overrides(&path.display().to_string(), &[slide])?)
}

/// Reads an arm from the text of a file; its height is the default.
fn read(text: &str, tip: Option<&Tip>) -> Result<Imported, String> {
    let limited = roxmltree::ParsingOptions {
        nodes_limit: MOST_NODES,
        ..roxmltree::ParsingOptions::default()
    };
    let document = roxmltree::Document::parse_with_options(text, limited);
    let document = document.map_err(|error| format!("it is not XML: {error}"))?;
    let root = document.root_element();
    let chain = match root.tag_name().name() {
        "robot" => urdf::chain(root)?,
        "mujoco" => mjcf::chain(root)?,
        other => {
            return Err(format!(
                "<{other}> is neither the <robot> of a URDF nor the <mujoco> of an MJCF file"
            ));
        }
    };
    planar::arm(&chain, tip)
}

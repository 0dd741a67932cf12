//! `cargo xtask soak`: a day of simulated operation, after which every counter
//! must still be exact. Takes about ten minutes; not part of CI.

use std::process::{Command, Stdio};

use clap::Args;
use serde_json::Value;

use crate::command::{ChoreError, run_cargo, say, workspace};

/// Options of the soak.
#[derive(Debug, Args)]
pub struct SoakArguments {
    /// Simulated hours with the native controller.
    #[arg(long, default_value_t = 24.0)]
    hours: f64,
    /// Simulated minutes with the image under QEMU; 0 for none.
    #[arg(long, default_value_t = 10.0)]
    qemu_minutes: f64,
}

/// Frame counters start this many ticks before they wrap.
const TICKS_BEFORE_WRAP: u32 = 10_000;

/// Runs the soak.
///
/// # Errors
/// If a run fails, or a value in its report differs from the expected one.
pub fn run(arguments: &SoakArguments) -> Result<(), ChoreError> {
    run_cargo(&["build", "--release", "--package", "painleve-command"])?;
    soak("native", 3600.0 * arguments.hours)?;
    if arguments.qemu_minutes > 0.0 {
        soak("qemu", 60.0 * arguments.qemu_minutes)?;
    }
    Ok(())
}

fn soak(host: &str, duration_s: f64) -> Result<(), ChoreError> {
    let program = workspace().join("target/release/painleve");
    eprintln!("soak test of the {host} host: {duration_s} simulated seconds");
    let output = Command::new(&program)
        .args(["run", "--json", "--no-record", "--no-plot", "--host", host])
        .args(["--set", &format!("run.duration_s={duration_s}")])
        .args([
            "--set",
            &format!("run.first_tick={}", u32::MAX - TICKS_BEFORE_WRAP),
        ])
        .current_dir(workspace())
        .stderr(Stdio::inherit())
        .output()
        .map_err(|error| ChoreError(format!("cannot start {}: {error}", program.display())))?;
    let report: Value = serde_json::from_slice(&output.stdout)
        .map_err(|error| ChoreError(format!("the {host} run gave no report: {error}")))?;
    let expected = [
        ("ticks", Value::from((duration_s * 1000.0).round() as u64)),
        ("stale_ticks", Value::from(0)),
        ("lift_offs", Value::from(0)),
        ("fault", Value::Null),
    ];
    for (key, value) in expected {
        if report[key] != value {
            let found = &report[key];
            return Err(ChoreError(format!(
                "the {host} run has {key} = {found} instead of {value}: {report}"
            )));
        }
    }
    say(&format!("{host}: {report}"))?;
    Ok(())
}

//! The sensors' lines without sensors: open, shorted to ground, shorted to the supply.

use std::time::Duration;

use painleve_board::Port;
use painleve_shared::counts::{EncoderCounts, ForceCounts};
use painleve_shared::frame::DigitalInputs;
use painleve_shared::message::{FrameSource, Request};

use crate::bench::{Bench, StepError};
use crate::chip::driver;
use crate::report::Check;

/// Longer than the board's check whether readings are plausible, 50 ticks.
const CHECKED: Duration = Duration::from_millis(120);

/// Ticks that are looked at in each state of the lines.
const TICKS: usize = 20;

/// Shorts and opens both lines.
///
/// # Errors
/// [`StepError`] if the board does not answer.
pub fn measure<P: Port>(bench: &mut Bench<P>) -> Result<Vec<Check>, StepError> {
    let mut checks = Vec::new();
    bench.switches([false, false, true])?;
    bench.configure(1000.0, FrameSource::DryRun)?;
    bench.board.send(&Request::PermitArming(true))?;
    bench.wait(CHECKED)?;
    bench.switches([true, false, true])?;
    for (name, level) in [
        ("shorted to ground", Some(false)),
        ("shorted to 3.3 V", Some(true)),
        ("open", None),
    ] {
        bench.drive(driver::ENCODERS, level)?;
        bench.drive(driver::FORCE_CELLS, level)?;
        bench.wait(CHECKED)?;
        if let Some(level) = level {
            for (line, pin) in [("encoders' line, PB4", 4), ("force cells' line, PB14", 14)] {
                let found = bench.level(1, pin)?;
                checks.push(Check::new(
                    format_args!("{line}, {name}"),
                    u8::from(found),
                    u8::from(level),
                    found == level,
                ));
            }
        }
        checks.push(readings(bench, name, level)?);
    }
    Ok(checks)
}

/// Counts the readings that a controller would take for those of an arm.
fn readings<P: Port>(
    bench: &mut Bench<P>,
    name: &str,
    level: Option<bool>,
) -> Result<Check, StepError> {
    let (mut joints, mut forces, mut enabled) = (0, 0, 0);
    for (sensor, _) in bench.ticks(TICKS)? {
        // All zeros are a reading, with which the board does not arm.
        let is_joint =
            |it: &EncoderCounts| ![EncoderCounts::MISSING, EncoderCounts(0)].contains(it);
        joints += u32::from(sensor.joints.iter().any(is_joint));
        let of_forces = [sensor.tangential_force, sensor.normal_force];
        forces += u32::from(of_forces.iter().any(|it| *it != ForceCounts::MISSING));
        enabled += u32::from(sensor.inputs.contains(DigitalInputs::ENABLE));
    }
    let is_defined = level.is_some();
    Ok(Check::new(
        format_args!("lines {name}: ticks with angles, with forces, with ENABLE"),
        format_args!("{joints}, {forces}, {enabled} of {TICKS}"),
        if is_defined {
            "none"
        } else {
            "none with ENABLE: an open line may give any bits, which no arm is driven by"
        },
        enabled == 0 && (!is_defined || (joints, forces) == (0, 0)),
    ))
}

//! The switches and the enable of the torque stages.

use std::time::Duration;

use painleve_board::Port;
use painleve_shared::frame::DigitalInputs;
use painleve_shared::message::{FrameSource, Request, Response};
use painleve_shared::status::SupervisorState;

use crate::bench::{Bench, StepError};
use crate::chip::{driver, port};
use crate::report::Check;

/// Ticks after which a switch has settled: it is debounced for five.
const SETTLED: Duration = Duration::from_millis(20);

/// Moves the switches and observes the stages' enable.
///
/// # Errors
/// [`StepError`] if the board does not answer.
pub fn measure<P: Port>(bench: &mut Bench<P>) -> Result<Vec<Check>, StepError> {
    let mut checks = Vec::new();
    let switches = [
        ("ENABLE at PC0", driver::ENABLE, 0),
        ("RESET at PC1", driver::RESET, 1),
        ("READY at PC2", driver::READY, 2),
    ];
    for (name, pin, input) in switches {
        let mut found = Vec::new();
        for level in [Some(false), Some(true), None] {
            bench.drive(pin, level)?;
            found.push(u8::from(bench.level(2, input)?));
        }
        checks.push(Check::new(
            format_args!("{name}, driven low, driven high, released"),
            format_args!("{found:?}"),
            "[0, 1, 0]: the wire is there, and the board pulls the pin down",
            found == [0, 1, 0],
        ));
    }
    checks.push(wire_of_stages(bench)?);

    // With the host's permission, every switch in turn: nothing arms without readings.
    bench.configure(1000.0, FrameSource::DryRun)?;
    let is_permission = |it: &Response| matches!(it, Response::Permission(_));
    let permission = bench.board.ask(
        &Request::PermitArming(true),
        Duration::from_millis(200),
        is_permission,
    )?;
    let mut armed = 0;
    let mut enabled = 0;
    let mut high = 0;
    let mut resets = [false; 2];
    for (number, levels) in [
        [false, false, true],
        [true, false, true],
        [true, false, false],
        [false, true, true],
        [false, false, true],
    ]
    .into_iter()
    .enumerate()
    {
        bench.switches(levels)?;
        bench.wait(SETTLED)?;
        for (sensor, answer) in bench.ticks(10)? {
            let state = answer.supervisor_state();
            armed += u32::from(!matches!(
                state,
                Some(SupervisorState::Idle | SupervisorState::Fault)
            ));
            enabled += u32::from(sensor.inputs.contains(DigitalInputs::ENABLE));
            let is_reset = sensor.inputs.contains(DigitalInputs::RESET);
            resets[usize::from(number == 3)] |= is_reset;
        }
        high += u32::from(bench.level(2, driver::STAGES)?);
        high += u32::from(bench.level(1, 0)?);
    }
    checks.push(Check::new(
        "permission of the host",
        format_args!("{permission:?}"),
        "Permission(true)",
        permission == Response::Permission(true),
    ));
    checks.push(Check::new(
        "ticks with ENABLE, and armed ones, with every switch closed but no sensors",
        format_args!("{enabled}, {armed}"),
        "none: nothing arms without plausible readings",
        (enabled, armed) == (0, 0),
    ));
    checks.push(Check::new(
        "RESET in the readings, pressed and not",
        format_args!("{}, {}", resets[1], resets[0]),
        "true, false",
        resets == [false, true],
    ));
    checks.push(Check::new(
        "enable of the torque stages, PB0, at its pin and at PC11",
        format_args!("{high} of 10 observations high"),
        "always low",
        high == 0,
    ));
    Ok(checks)
}

/// Finds whether the wire from PB0 to PC11 is there: the pin's pull-up does not win against an output.
fn wire_of_stages<P: Port>(bench: &mut Bench<P>) -> Result<Check, StepError> {
    let [_, _, c] = bench.chip()?.ports;
    let shift = 2 * driver::STAGES;
    bench.modify(c + port::MODES, 3 << shift, 0)?;
    bench.modify(c + port::PULLS, 3 << shift, 1 << shift)?;
    let level = bench.level(2, driver::STAGES)?;
    Ok(Check::new(
        "PC11 with a pull-up, wired to PB0",
        u8::from(level),
        "0: PB0 is driven low",
        !level,
    ))
}

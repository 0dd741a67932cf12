//! The outputs of u1 and u2, PA4 and PA5, which the chip's analog-to-digital converter reads at the same pins.

use std::time::Duration;

use painleve_board::Port;
use painleve_shared::message::Probe;

use crate::bench::{Bench, StepError};
use crate::chip::Converter;
use crate::report::Check;

/// Codes of u1; u2 gets their opposites.
const CODES: [u32; 5] = [205, 1024, 2048, 3072, 3890];

/// Code for zero torque.
const ZERO: u32 = 2048;

/// Largest difference, codes: 1 % of the range for both converters' offsets and gains.
const TOLERANCE: u32 = 41;

/// Names of the outputs.
const NAMES: [&str; 2] = ["u1 at PA4", "u2 at PA5"];

/// Puts codes out and reads them back. Without frames from the host, nothing else puts codes out.
///
/// # Errors
/// [`StepError`] if the board does not answer.
pub fn measure<P: Port>(bench: &mut Bench<P>) -> Result<Vec<Check>, StepError> {
    let chip = bench.chip()?;
    let converter = &chip.converter;
    for (address, value) in converter.preparation {
        bench.store(*address, *value)?;
        // Longer than a calibration and the start of a regulator.
        bench.wait(Duration::from_millis(1))?;
    }
    let mut checks = Vec::new();
    for (channel, name) in NAMES.into_iter().enumerate() {
        let mut found = Vec::new();
        for code in CODES {
            let codes = [code, 4095 - code];
            let both = (codes[1] << 16) | codes[0];
            let reading = read(bench, converter, channel, Some((chip.codes, both)))?;
            found.push((codes[channel], reading));
        }
        let worst = found.iter().map(|(code, it)| code.abs_diff(*it)).max();
        let words = found.iter().map(|(code, it)| format!("{code} → {it}"));
        checks.push(Check::new(
            format_args!("{name}, code → reading"),
            words.collect::<Vec<_>>().join(", "),
            format_args!("the same ± {TOLERANCE}"),
            worst.is_some_and(|it| it <= TOLERANCE),
        ));
    }
    // A new configuration takes the torque off.
    bench.rest()?;
    for (channel, name) in NAMES.into_iter().enumerate() {
        let reading = read(bench, converter, channel, None)?;
        checks.push(Check::new(
            format_args!("{name} after the torque was taken off"),
            reading,
            format_args!("{ZERO} ± {TOLERANCE}, half of the supply"),
            reading.abs_diff(ZERO) <= TOLERANCE,
        ));
    }
    Ok(checks)
}

/// Puts codes out, if there are any, and reads a channel.
fn read<P: Port>(
    bench: &mut Bench<P>,
    converter: &Converter,
    channel: usize,
    codes: Option<(u32, u32)>,
) -> Result<u32, StepError> {
    bench.store(converter.selection_address, converter.selections[channel])?;
    let start = (converter.start_address, converter.start);
    let stores = codes.into_iter().chain([start]);
    let mut probes: Vec<Probe> = stores
        .map(|(address, value)| Probe::Store { address, value })
        .collect();
    // Long enough for a conversion.
    let wait = Probe::Load {
        address: crate::chip::PROCESSOR,
    };
    let result = Probe::Load {
        address: converter.result,
    };
    probes.extend([wait, wait, result]);
    let answers = bench.probe_all(&probes)?;
    Ok(answers.last().map_or(0, |it| it.value & 0xfff))
}

//! Release of the ticks: the control timer captures its own count at the select of encoder 1, PB6 wired to PA0. No
//! program takes part in the measurement.
//!
//! With the encoders' line at ground, a tick selects the encoder three times, the second time after the control
//! interrupt. The timer captures every eighth edge, so that the first one of a tick is among them again and again. One that is
//! as late as a usual second one cannot be told from it: the report shows these captures, too.

use painleve_board::Port;
use painleve_shared::message::{FrameSource, Probe};

use crate::bench::{Bench, StepError};
use crate::chip::{driver, port, timer};
use crate::report::Check;

/// Ticks after which the capture is read.
const TICKS: usize = 300;

/// Fewest first edges among them: without the wire there is none, with it some 70.
const FEWEST: usize = 15;

/// Time by which the second select of a tick may be earlier than usual, µs.
const EARLIER_US: f64 = 1.0;

/// Captures the input of the first channel at every eighth edge.
const EVERY_EIGHTH: u32 = 0b1101;

/// Captures the starts of ticks.
///
/// # Errors
/// [`StepError`] if the board does not answer.
pub fn measure<P: Port>(bench: &mut Bench<P>) -> Result<Vec<Check>, StepError> {
    let chip = bench.chip()?;
    bench.drive(driver::ENCODERS, Some(false))?;
    bench.configure(1000.0, FrameSource::DryRun)?;
    let [a, ..] = chip.ports;
    // PA0 belongs to the timer, whose first channel captures at falling edges.
    bench.modify(a + port::FUNCTIONS, 15, 1)?;
    bench.modify(a + port::MODES, 3, 2)?;
    bench.store(timer::MODES, EVERY_EIGHTH)?;
    bench.store(timer::EDGES, 3)?;
    let mut all_us = Vec::new();
    for _ in 0..TICKS {
        // Reading the capture clears its flag.
        let loads = [timer::FLAGS, timer::CAPTURE].map(|address| Probe::Load { address });
        let answers = bench.probe_all(&loads)?;
        if answers[0].value & 2 != 0 {
            all_us.push(1e6 * f64::from(answers[1].value) / chip.timer_hz);
        }
        bench.ticks(1)?;
    }
    bench.drive(driver::ENCODERS, None)?;
    all_us.sort_by(f64::total_cmp);
    // Each of the three selects is captured as often: the median is a usual second one.
    let second_us = all_us.get(all_us.len() / 2).copied().unwrap_or_default();
    let firsts = all_us.partition_point(|it| *it < second_us - EARLIER_US);
    let (first_us, further_us) = all_us.split_at(firsts);
    let mut checks = vec![Check::new(
        "captures at PA0, and those of the first select of a tick",
        format_args!("{}, {firsts} in {TICKS} ticks", all_us.len()),
        format_args!("at least {FEWEST} of the latter: the wire from PB6 is there"),
        firsts >= FEWEST,
    )];
    if let [earliest, .., latest] = *first_us {
        let median = first_us[firsts / 2];
        let jitter = latest - earliest;
        let most = 1e6 * f64::from(chip.release_cycles) / chip.core_hz;
        checks.push(Check::note(
            "first select after the timer's event",
            format_args!("{earliest:.2} µs to {latest:.2} µs, median {median:.2} µs"),
        ));
        checks.push(Check::new(
            "jitter: latest less earliest",
            format_args!("{jitter:.2} µs"),
            format_args!("at most {most:.1} µs, the proved bound"),
            jitter <= most,
        ));
    }
    if let [earliest, .., latest] = *further_us {
        checks.push(Check::note(
            "captures of further selects, or of a first one as late as these",
            format_args!("{}, {earliest:.2} µs to {latest:.2} µs", further_us.len()),
        ));
    }
    Ok(checks)
}

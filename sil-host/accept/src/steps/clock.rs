//! The processor's clock against the host's.

use std::time::Duration;

use painleve_board::Port;

use crate::bench::{Bench, StepError};
use crate::chip::{PROCESSOR, timer};
use crate::report::Check;

/// Time between two readings of the cycle counter, which wraps after 25 s.
const BETWEEN: Duration = Duration::from_secs(2);

/// Readings at either end, of which the one with the shortest exchange counts.
const READINGS: usize = 8;

/// Largest relative deviation: a crystal has 50 ppm; the rest is the host's uncertainty about the time of a reading.
const DEVIATION: f64 = 2e-3;

/// Compares the clocks.
///
/// # Errors
/// [`StepError`] if the board does not answer.
pub fn measure<P: Port>(bench: &mut Bench<P>) -> Result<Vec<Check>, StepError> {
    let chip = bench.chip()?;
    let first = reading(bench)?;
    bench.wait(BETWEEN)?;
    let second = reading(bench)?;
    let seconds = (second.at - first.at).as_secs_f64();
    let hz = f64::from(second.cycles.wrapping_sub(first.cycles)) / seconds;
    let uncertain = (first.exchange + second.exchange).as_secs_f64() / 2.0 / seconds;
    let deviation = (hz / chip.core_hz - 1.0).abs();
    let reload = bench.load(timer::RELOAD)?.value;
    let period_us = 1e6 * (f64::from(reload) + 1.0) / chip.timer_hz;
    Ok(vec![
        Check::new(
            "processor's clock",
            format_args!(
                "{:.3} MHz ± {:.3} % by the host's clock",
                hz / 1e6,
                100.0 * uncertain
            ),
            format_args!("{:.0} MHz ± {:.1} %", chip.core_hz / 1e6, 100.0 * DEVIATION),
            deviation <= DEVIATION + uncertain,
        ),
        Check::new(
            "period of the control timer at 1 kHz, by its registers",
            format_args!("{period_us:.3} µs"),
            "1000 µs",
            (period_us - 1000.0).abs() < 0.1,
        ),
    ])
}

struct Reading {
    cycles: u32,
    at: Duration,
    exchange: Duration,
}

fn reading<P: Port>(bench: &mut Bench<P>) -> Result<Reading, StepError> {
    let mut best: Option<Reading> = None;
    for _ in 0..READINGS {
        let before = bench.board.now();
        let cycles = bench.load(PROCESSOR)?.cycles;
        let exchange = bench.board.now() - before;
        if best.as_ref().is_none_or(|it| exchange < it.exchange) {
            best = Some(Reading {
                cycles,
                at: before + exchange / 2,
                exchange,
            });
        }
    }
    best.ok_or(StepError::Lost {
        missing: READINGS,
        sent: READINGS,
    })
}

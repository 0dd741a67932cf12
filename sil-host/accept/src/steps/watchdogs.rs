//! Both watchdogs: the control timer is stopped, and the cycle counter of the last answer before the reset tells when
//! it came.

use std::time::Duration;

use painleve_board::Port;
use painleve_shared::black_box::ResetCause;
use painleve_shared::message::{FrameSource, Probe};

use crate::bench::{Bench, StepError};
use crate::chip::{Chip, FEED_INDEPENDENT, INDEPENDENT, WINDOW, timer};
use crate::report::Check;

/// Control rate, at which the limits are longer than the exchange of a probe, Hz.
const RATE_HZ: f64 = 100.0;

/// Longest silence that is no reset yet.
const SILENCE: Duration = Duration::from_millis(40);

/// Time after which a watchdog counts as dead, in periods.
const DEAD_PERIODS: f64 = 15.0;

/// The largest count of the window watchdog.
const LONGEST: u32 = 0x7f;

/// Lets each watchdog reset the board.
///
/// # Errors
/// [`StepError`] if the board does not answer.
pub fn measure<P: Port>(bench: &mut Bench<P>) -> Result<Vec<Check>, StepError> {
    let chip = bench.chip()?;
    let mut checks = Vec::new();
    let period_ms = 1e3 / RATE_HZ;
    bench.configure(RATE_HZ as f32, FrameSource::Lockstep)?;
    // Each watchdog alone: the host feeds the other one.
    let (address, value) = FEED_INDEPENDENT;
    let feed = Probe::Store { address, value };
    if let Some(window) = expiry(bench, chip, feed, "window watchdog", &mut checks)? {
        checks.push(Check::new(
            "window watchdog: time from the last tick to the reset",
            &window,
            format_args!(
                "{period_ms} ms to {} ms: one to two periods",
                2.0 * period_ms
            ),
            window.may_be_within(period_ms, 2.0 * period_ms),
        ));
    }
    bench.configure(RATE_HZ as f32, FrameSource::Lockstep)?;
    let [prescaler, reload] = INDEPENDENT;
    let prescaler = bench.load(prescaler)?.value & 7;
    let counts = (bench.load(reload)?.value & 0xfff) + 1;
    let cycles = f64::from(counts * (4 << prescaler.min(6)));
    let feed = Probe::Store {
        address: WINDOW,
        value: LONGEST,
    };
    if let Some(independent) = expiry(bench, chip, feed, "independent watchdog", &mut checks)? {
        let [slowest, fastest] = chip.oscillator_hz;
        let khz = independent.ms.map(|it| cycles / it);
        let [shortest, longest] = [fastest, slowest].map(|it| 1e3 * cycles / it);
        checks.push(Check::new(
            "independent watchdog: time from the last tick to the reset, the window watchdog being fed",
            format_args!("{independent}; oscillator at {:.1} kHz to {:.1} kHz", khz[1], khz[0]),
            format_args!(
                "{shortest:.1} ms to {longest:.1} ms: oscillator at {:.1} kHz to {:.1} kHz",
                slowest / 1e3,
                fastest / 1e3
            ),
            independent.may_be_within(shortest, longest),
        ));
    }
    Ok(checks)
}

/// Time between the last tick and a reset, ms: at least, at most.
struct Expiry {
    ms: [f64; 2],
}

impl Expiry {
    fn may_be_within(&self, earliest_ms: f64, latest_ms: f64) -> bool {
        let [least, most] = self.ms;
        most >= earliest_ms && least <= latest_ms
    }
}

impl core::fmt::Display for Expiry {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let [least, most] = self.ms;
        write!(f, "{least:.1} ms to {most:.1} ms")
    }
}

/// Stops the control timer and repeats a probe until the board is reset; `None` if it is not.
fn expiry<P: Port>(
    bench: &mut Bench<P>,
    chip: &Chip,
    probe: Probe,
    name: &str,
    checks: &mut Vec<Check>,
) -> Result<Option<Expiry>, StepError> {
    let starts = bench.board.black_box()?.starts;
    // The count tells when the last tick was.
    let stop = [
        Probe::Store {
            address: timer::CONTROL,
            value: 0,
        },
        Probe::Load {
            address: timer::COUNT,
        },
    ];
    let stopped = bench.probe_all(&stop)?;
    let since_tick_ms = 1e3 * f64::from(stopped[1].value) / chip.timer_hz;
    let ms = |cycles: u32| {
        since_tick_ms + 1e3 * f64::from(cycles.wrapping_sub(stopped[0].cycles)) / chip.core_hz
    };
    let mut last = stopped[1].cycles;
    // From one answer to the next: the reset comes within this time after the last answer.
    let mut longest_gap = 0;
    while let Some(answer) = bench.try_probe(probe, SILENCE)? {
        longest_gap = longest_gap.max(answer.cycles.wrapping_sub(last));
        last = answer.cycles;
        if ms(last) > DEAD_PERIODS * 1e3 / RATE_HZ {
            checks.push(Check::new(
                format_args!("{name}: reset after the last tick"),
                format_args!("none within {:.0} ms", ms(last)),
                "a reset",
                false,
            ));
            bench.reset()?;
            return Ok(None);
        }
    }
    let record = bench.wait_for_start()?;
    checks.push(Check::new(
        format_args!("{name}: reason of the reset, and starts"),
        format_args!("{:?}, {}", record.reset, record.starts.wrapping_sub(starts)),
        "Watchdog, 1",
        record.reset == ResetCause::Watchdog && record.starts == starts + 1,
    ));
    Ok(Some(Expiry {
        ms: [ms(last), ms(last.wrapping_add(2 * longest_gap))],
    }))
}

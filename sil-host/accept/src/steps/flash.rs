//! The flash's slots for configurations: a reset interrupts the storing at several times.

use std::time::Duration;

use painleve_board::Port;
use painleve_plant::Configuration;
use painleve_shared::message::{FrameSource, Probe, Request, Response};
use painleve_shared::stored::{StoredConfiguration, StoredState};

use crate::bench::{Bench, StepError};
use crate::chip::PROCESSOR;
use crate::report::Check;

/// Resets that interrupt a storing: half of them before the flash is written, half meanwhile.
const CUTS: u32 = 6;

/// Largest count of the timer that resets the board, at an eighth of the processor's clock. While the board erases it carries
/// out no probe that starts the timer again.
const LONGEST: f64 = 16_777_215.0;

/// Time beyond the longest store until the answer has come.
const MARGIN: Duration = Duration::from_millis(200);

/// Stores, interrupts and erases.
///
/// # Errors
/// [`StepError`] if the board does not answer.
pub fn measure<P: Port>(bench: &mut Bench<P>) -> Result<Vec<Check>, StepError> {
    let chip = bench.chip()?;
    let configuration = bench.scenario().controller_configuration();
    let mut checks = Vec::new();
    let (answer, taken_s) = timed_store(bench, &configuration)?;
    let Response::Stored(stored) = answer else {
        let answer = format!("{answer:?}");
        checks.push(Check::new("stored", answer, "Intact, version 1", false));
        return Ok(checks);
    };
    checks.push(is("stored", stored, StoredState::Intact, 1));
    checks.push(Check::new(
        "time to store",
        format_args!("{taken_s:.3} s"),
        format_args!("at most {} s, by the data sheet", chip.store_s),
        taken_s <= chip.store_s,
    ));
    bench.reset()?;
    let found = bench.board.stored()?;
    checks.push(is("after a reset", found, StoredState::Intact, 1));

    let mut version = found.version;
    let mut lost = Vec::new();
    let mut cut = [0; 2];
    // Relative to the whole, which the board has measured.
    let writing_s = taken_s - chip.writing_s;
    let reach_s = 8.0 * LONGEST / chip.core_hz;
    let is_in_reach = taken_s < reach_s;
    for number in 0..CUTS {
        bench.configure(1000.0, FrameSource::Lockstep)?;
        let (part, place) = (number / (CUTS / 2), number % (CUTS / 2));
        let (from_s, to_s) = if part == 1 && is_in_reach {
            (writing_s, taken_s)
        } else {
            (0.0, writing_s.min(reach_s))
        };
        let share = (f64::from(place) + 0.5) / f64::from(CUTS / 2);
        let delay_s = from_s + share * (to_s - from_s);
        bench.reset_after((delay_s * chip.core_hz / 8.0) as u32)?;
        bench.board.begin_to_store(&configuration)?;
        bench.wait(Duration::from_secs_f64(delay_s))?;
        bench.wait_for_start()?;
        let found = bench.board.stored()?;
        let is_old = found.version == version;
        cut[part as usize] += u32::from(is_old);
        if found.state != StoredState::Intact || !(is_old || found.version == version + 1) {
            lost.push(format!(
                "cut {number}: {:?}, version {}",
                found.state, found.version
            ));
        }
        version = found.version;
    }
    let [before, meanwhile] = cut;
    checks.push(Check::new(
        format_args!("configurations lost in {CUTS} resets while another was stored"),
        if lost.is_empty() {
            format!("none; {} stored", CUTS - before - meanwhile)
        } else {
            lost.join("; ")
        },
        "none: the old one or the new one",
        lost.is_empty(),
    ));
    checks.push(if is_in_reach {
        Check::new(
            "resets that interrupted the storing, before and after the writing began",
            format_args!("{before}, {meanwhile}"),
            "some of each",
            before > 0 && meanwhile > 0,
        )
    } else {
        Check::new(
            "resets that interrupted the storing",
            before + meanwhile,
            format_args!(
                "some; all in the erasure: the timer that resets the board counts for {reach_s:.2} s, the writing begins after \
                 {writing_s:.2} s"
            ),
            before + meanwhile > 0,
        )
    });
    bench.configure(1000.0, FrameSource::Lockstep)?;
    checks.push(match bench.board.forget() {
        Ok(found) => is("erased", found, StoredState::Empty, 0),
        Err(error) => Check::new("erased", error, "Empty, version 0", false),
    });
    bench.reset()?;
    let found = bench.board.stored()?;
    checks.push(is("after a reset", found, StoredState::Empty, 0));
    Ok(checks)
}

/// Stores a configuration between two probes; the answer, and the time between them by the board's clock, s.
fn timed_store<P: Port>(
    bench: &mut Bench<P>,
    configuration: &Configuration,
) -> Result<(Response, f64), StepError> {
    let chip = bench.chip()?;
    let look = Request::Probe(Probe::Load { address: PROCESSOR });
    bench.board.send(&look)?;
    bench.board.begin_to_store(configuration)?;
    bench.board.send(&look)?;
    let end = bench.board.now() + Duration::from_secs_f64(chip.store_s) + MARGIN;
    let (mut looks, mut stored) = (Vec::new(), None);
    loop {
        let left = end.saturating_sub(bench.board.now());
        match bench.board.listen(left)? {
            Some(Response::Probed { stopwatch, .. }) => looks.push(stopwatch),
            Some(
                answer @ (Response::Stored(_)
                | Response::Refused
                | Response::RateRefused(_)
                | Response::OtherBuild { .. }),
            ) => stored = Some(answer),
            None if left.is_zero() => {
                let missing = 2_usize.saturating_sub(looks.len()).max(1);
                return Err(StepError::Lost { missing, sent: 3 });
            }
            _ => {}
        }
        if let (&[before, after], Some(stored)) = (&looks[..], stored) {
            let cycles = after.wrapping_sub(before);
            return Ok((stored, f64::from(cycles) / chip.core_hz));
        }
    }
}

fn is(what: &str, found: StoredConfiguration, state: StoredState, version: u32) -> Check {
    Check::new(
        what,
        format_args!("{:?}, version {}", found.state, found.version),
        format_args!("{state:?}, version {version}"),
        found.state == state && found.version == version,
    )
}

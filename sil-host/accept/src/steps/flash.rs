//! The flash's slots for configurations: a reset interrupts the storing at several times.

use std::time::Duration;

use painleve_board::Port;
use painleve_shared::message::FrameSource;
use painleve_shared::stored::{StoredConfiguration, StoredState};

use crate::bench::{Bench, StepError};
use crate::report::Check;

/// Resets that interrupt a storing.
const CUTS: u32 = 6;

/// Largest count of the timer that resets the board, at an eighth of the processor's clock.
const LONGEST: f64 = 16_777_215.0;

/// Stores, interrupts and erases.
///
/// # Errors
/// [`StepError`] if the board does not answer.
pub fn measure<P: Port>(bench: &mut Bench<P>) -> Result<Vec<Check>, StepError> {
    let chip = bench.chip()?;
    let configuration = bench.scenario().controller_configuration();
    let mut checks = Vec::new();
    let start = bench.board.now();
    let stored = bench.board.store(&configuration);
    let taken_s = (bench.board.now() - start).as_secs_f64();
    let stored = match stored {
        Ok(stored) => stored,
        Err(error) => {
            checks.push(Check::new("stored", error, "Intact, version 1", false));
            return Ok(checks);
        }
    };
    checks.push(is("stored", stored, StoredState::Intact, 1));
    checks.push(Check::new(
        "time to store",
        format_args!("{taken_s:.2} s"),
        format_args!("at most {} s, by the data sheet", chip.store_s),
        taken_s <= chip.store_s,
    ));
    bench.reset()?;
    let found = bench.board.stored()?;
    checks.push(is("after a reset", found, StoredState::Intact, 1));

    let mut version = found.version;
    let mut lost = Vec::new();
    let mut cut = 0;
    for number in 0..CUTS {
        bench.configure(1000.0, FrameSource::Lockstep)?;
        let share = (f64::from(number) + 0.5) / f64::from(CUTS);
        let delay_s = share * taken_s;
        let counts = (delay_s * chip.core_hz / 8.0).min(LONGEST);
        bench.reset_after(counts as u32)?;
        bench.board.begin_to_store(&configuration)?;
        bench.wait(Duration::from_secs_f64(delay_s))?;
        bench.wait_for_start()?;
        let found = bench.board.stored()?;
        let is_old = found.version == version;
        cut += u32::from(is_old);
        if found.state != StoredState::Intact || !(is_old || found.version == version + 1) {
            lost.push(format!(
                "cut {number}: {:?}, version {}",
                found.state, found.version
            ));
        }
        version = found.version;
    }
    checks.push(Check::new(
        format_args!("configurations lost in {CUTS} resets while another was stored"),
        if lost.is_empty() {
            format!("none; {cut} interrupted, {} stored", CUTS - cut)
        } else {
            lost.join("; ")
        },
        "none: the old one or the new one",
        lost.is_empty(),
    ));
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

fn is(what: &str, found: StoredConfiguration, state: StoredState, version: u32) -> Check {
    Check::new(
        what,
        format_args!("{:?}, version {}", found.state, found.version),
        format_args!("{state:?}, version {version}"),
        found.state == state && found.version == version,
    )
}

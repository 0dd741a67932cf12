//! Acceptance of a bare board, without an arm: measures, over the board's serial line, what its image relies on.
//!
//! The torque stages stay off throughout. Outputs are observed through loop-back wires ([`chip::WIRES`]) and by the
//! chip's own converter and timer. Every step compares what it has measured with what is expected; a step that fails
//! does not end the acceptance, unless the chip is unknown. The steps, in their order, are the modules of [`steps`](mod@steps).
//!
//! The board takes part with one request, [`Probe`](painleve_shared::message::Probe): it loads words and stores bits
//! on which no torque depends. All knowledge about the chips is here ([`chip`]).

mod bench;
pub mod chip;
mod html;
mod report;
pub mod steps;

use core::ops::ControlFlow;

use painleve_board::{BoardError, Port, Serial};
use painleve_shared::stored::{StoredConfiguration, StoredState};

pub use bench::{Bench, StepError};
pub use report::{Acceptance, Check, StepReport, Verdict};

use crate::steps::steps;

/// Reason why a board cannot be accepted at all.
#[derive(Debug, thiserror::Error)]
pub enum AcceptError {
    /// The board does not answer, or its image is another one.
    #[error(transparent)]
    Board(#[from] BoardError),
    /// The acceptance would erase a configuration.
    #[error(
        "the board holds a stored configuration, which the acceptance would erase: remove it with `painleve drive --port PORT --forget` first"
    )]
    Stored,
    /// The caller has ended it.
    #[error("interrupted")]
    Interrupted,
}

/// Accepts a board: carries out every step and calls `done` after each, which may end the acceptance. Whatever ends it, no
/// configuration is left on the board.
///
/// # Errors
/// [`AcceptError`] if the board does not answer at the start, has another image or holds a configuration, or if `done` has
/// ended it.
pub fn accept<P: Port>(
    mut board: Serial<P>,
    mut done: impl FnMut(&StepReport) -> ControlFlow<()>,
) -> Result<Acceptance, AcceptError> {
    board.identify()?;
    let stored = board.stored()?.state;
    if stored != StoredState::Empty {
        return Err(AcceptError::Stored);
    }
    let mut bench = Bench::new(board);
    let (mut reports, mut is_ended) = (Vec::new(), false);
    for step in steps::<P>() {
        let start = bench.board.now();
        // Each step begins with a board that waits for frames.
        let checks = match bench.rest().and_then(|()| (step.carry_out)(&mut bench)) {
            Ok(checks) => checks,
            Err(error) => vec![Check::failure(&error)],
        };
        let report = StepReport {
            name: step.name,
            question: step.question,
            verdict: Verdict::of(&checks),
            duration_s: (bench.board.now() - start).as_secs_f64(),
            checks,
        };
        is_ended = done(&report).is_break();
        reports.push(report);
        // Nothing is known of its registers.
        if is_ended || bench.chip.is_none() {
            break;
        }
    }
    let storing = reports.iter().position(|it| it.name == "flash");
    let storing = storing.unwrap_or(0);
    if let (Some(check), Some(report)) = (empty(&mut bench), reports.get_mut(storing)) {
        report.checks.push(check);
        report.verdict = Verdict::of(&report.checks);
        is_ended |= done(report).is_break();
    }
    // Registers have their usual values again, and the board may drive an arm.
    let _ = bench.reset();
    if is_ended {
        return Err(AcceptError::Interrupted);
    }
    Ok(Acceptance::new(bench.chip, reports))
}

/// Erases the configuration that a step has left behind when it failed: with it, the board would drive an arm by itself.
/// Returns a check that has failed if that does not work.
fn empty<P: Port>(bench: &mut Bench<P>) -> Option<Check> {
    let is_empty = |found: &StoredConfiguration| found.state == StoredState::Empty;
    if bench.board.stored().is_ok_and(|found| is_empty(&found)) {
        return None;
    }
    // It erases only while it waits for frames.
    let left = match bench.rest().and_then(|()| Ok(bench.board.forget()?)) {
        Ok(found) if is_empty(&found) => return None,
        Ok(found) => format!("{:?}, version {}", found.state, found.version),
        Err(error) => error.to_string(),
    };
    let expected = "Empty: erase it with `painleve drive --port PORT --forget`";
    Some(Check::new(
        "stored configuration at the end",
        left,
        expected,
        false,
    ))
}

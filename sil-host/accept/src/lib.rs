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

use painleve_board::{BoardError, Port, Serial};
use painleve_shared::stored::StoredState;

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
        "the board holds a stored configuration, which the acceptance would erase: remove it with `painleve drive --forget` first"
    )]
    Stored,
}

/// Accepts a board: carries out every step and calls `done` after each.
///
/// # Errors
/// [`AcceptError`] if the board does not answer at the start, has another image or holds a configuration.
pub fn accept<P: Port>(
    mut board: Serial<P>,
    mut done: impl FnMut(&StepReport),
) -> Result<Acceptance, AcceptError> {
    board.identify()?;
    let stored = board.stored()?.state;
    if !matches!(stored, StoredState::Empty | StoredState::NoMemory) {
        return Err(AcceptError::Stored);
    }
    let mut bench = Bench::new(board);
    let mut reports = Vec::new();
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
        done(&report);
        reports.push(report);
        // Nothing is known of its registers.
        if bench.chip.is_none() {
            break;
        }
    }
    // Registers have their usual values again, and the board may drive an arm.
    let _ = bench.reset();
    Ok(Acceptance::new(bench.chip, reports))
}

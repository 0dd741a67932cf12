//! The serial line at its full rate.

use std::time::Duration;

use painleve_board::{ConnectedBoard, Port};
use painleve_shared::counts::TorqueCounts;
use painleve_shared::message::{Request, Response};

use crate::bench::{Bench, StepError};
use crate::report::Check;

/// Requests without an answer, 17 bytes each: half a second of the line.
const TO_BOARD: usize = 2700;

/// Requests with an answer, and how many are under way at once.
const TO_HOST: usize = 2000;
const TOGETHER: usize = 4;

/// Sends as fast as the line permits, in either direction.
///
/// # Errors
/// [`StepError`] if the board does not answer at all.
pub fn measure<P: Port>(bench: &mut Bench<P>) -> Result<Vec<Check>, StepError> {
    let board = &mut bench.board;
    let before = board.line().unwrap_or_default();
    let request = Request::Torque([TorqueCounts(i32::MIN); 2]);
    for _ in 0..TO_BOARD {
        board.send(&request)?;
    }
    // Behind all of them.
    let health = board.health()?;
    let garbage = health.lapses.garbage;
    let checksums = health.lapses.failed_checksums;
    let mut answered = 0;
    for _ in 0..TO_HOST / TOGETHER {
        for _ in 0..TOGETHER {
            board.send(&Request::BlackBox)?;
        }
        let mut missing = TOGETHER;
        while missing > 0 {
            match board.listen(Duration::from_millis(100))? {
                Some(Response::BlackBox(_)) => missing -= 1,
                Some(_) => {}
                None => break,
            }
        }
        answered += TOGETHER - missing;
    }
    let after = board.line().unwrap_or_default();
    let noise = after.garbage - before.garbage + after.failed_checksums - before.failed_checksums;
    Ok(vec![
        Check::new(
            format_args!("damaged among {TO_BOARD} messages to the board, without a pause"),
            format_args!("{garbage} no messages, {checksums} with a wrong checksum"),
            "0",
            garbage == 0 && checksums == 0,
        ),
        Check::new(
            "answered requests, without a pause on the line to the host",
            format_args!("{answered} of {TO_HOST}"),
            "all",
            answered == TO_HOST,
        ),
        Check::new("damaged messages to the host", noise, "0", noise == 0),
    ])
}

//! The image's log, in a buffer from which a debug probe takes it (SEGGER RTT). Here the board's words are looked at.

use painleve_board::Port;
use painleve_shared::message::Probe;

use crate::bench::{Bench, StepError};
use crate::report::Check;

/// First word of the buffer's header: "SEGG".
const MAGIC: u32 = u32::from_le_bytes(*b"SEGG");

/// Offsets in the header of the first channel's length, bytes written and flags.
const LENGTH: u32 = 0x20;
const WRITTEN: u32 = 0x24;
const FLAGS: u32 = 0x2c;

/// Mode in which the image waits for a reader.
const BLOCKING: u32 = 2;

/// Finds the buffer and what is in it.
///
/// # Errors
/// [`StepError`] if the board does not answer.
pub fn measure<P: Port>(bench: &mut Bench<P>) -> Result<Vec<Check>, StepError> {
    let chip = bench.chip()?;
    let start = chip.variables_address;
    let addresses: Vec<u32> = (start..start + chip.variables_bytes).step_by(4).collect();
    let mut header = None;
    for some in addresses.chunks(256) {
        let loads: Vec<Probe> = some
            .iter()
            .map(|address| Probe::Load { address: *address })
            .collect();
        let found = bench.probe_all(&loads)?;
        if let Some(at) = found.iter().position(|it| it.value == MAGIC) {
            header = Some(some[at]);
            break;
        }
    }
    let Some(header) = header else {
        return Ok(vec![Check::new(
            "buffer of the log",
            "not found",
            "in the variables",
            false,
        )]);
    };
    let length = bench.load(header + LENGTH)?.value;
    let written = bench.load(header + WRITTEN)?.value;
    let mode = bench.load(header + FLAGS)?.value & 3;
    Ok(vec![
        Check::new(
            "log since the start",
            format_args!("{written} of {length} bytes written"),
            "some: the image has logged its start",
            written > 0,
        ),
        Check::new(
            "mode of the log without a reader",
            mode,
            format_args!("not {BLOCKING}: the image does not wait"),
            mode != BLOCKING,
        ),
    ])
}

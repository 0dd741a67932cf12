//! The black box in RAM that no start initialises: reset, crash and fault outlive a reset.
//!
//! Its content is encoded with a checksum, so that the random content of RAM after power has come up, and a
//! record that was interrupted half-way, count as empty.

#![allow(unsafe_code)] // memory outside the program's own initialisation

use core::mem::MaybeUninit;
use core::ptr::{addr_of, addr_of_mut};

use painleve_shared::black_box::{BlackBox, Crash, FILE_LENGTH, FaultRecord, ResetCause};
use painleve_shared::wire;

/// Longest encoded record, bytes.
const LENGTH: usize = 192;

#[unsafe(link_section = ".uninit.BLACK_BOX")]
static mut RECORD: MaybeUninit<[u8; LENGTH]> = MaybeUninit::uninit();

/// Records a start of the processor. Must be called once, before the control task runs.
pub fn note_start(reset: ResetCause) {
    let before = read();
    let is_kept = reset != ResetCause::Power;
    let kept = if is_kept { before } else { BlackBox::default() };
    write(&BlackBox {
        reset,
        starts: kept.starts.saturating_add(1),
        ..kept
    });
}

/// Records a crash. The program must not continue afterwards.
pub fn note_crash(crash: Crash) {
    write(&BlackBox {
        crash: Some(crash),
        ..read()
    });
}

/// Records the tick that latched a fault.
#[cold]
#[inline(never)]
pub fn note_fault(fault: FaultRecord) {
    write(&BlackBox {
        fault: Some(fault),
        ..read()
    });
}

/// Returns the end of a file's name, padded with zeros.
pub fn end_of(file: &str) -> [u8; FILE_LENGTH] {
    let mut end = [0; FILE_LENGTH];
    let skipped = file.len().saturating_sub(FILE_LENGTH);
    for (place, byte) in end.iter_mut().zip(file.bytes().skip(skipped)) {
        *place = byte;
    }
    end
}

/// Returns the content; empty if it is not intact.
pub fn read() -> BlackBox {
    // SAFETY: every byte of RAM is initialised for the processor; the checksum decides about the content. A
    // record that is changed meanwhile fails it.
    let mut bytes = unsafe { addr_of!(RECORD).cast::<[u8; LENGTH]>().read_volatile() };
    let Some(end) = bytes.iter().position(|byte| *byte == 0) else {
        return BlackBox::default();
    };
    bytes
        .get_mut(..end)
        .and_then(|message| wire::decode(message).ok())
        .unwrap_or_default()
}

fn write(content: &BlackBox) {
    let mut bytes = [0; LENGTH];
    if wire::encode(content, &mut bytes).is_ok() {
        // SAFETY: an array of bytes in RAM that only this module uses; a reader checks the checksum.
        unsafe {
            addr_of_mut!(RECORD)
                .cast::<[u8; LENGTH]>()
                .write_volatile(bytes);
        }
    }
}

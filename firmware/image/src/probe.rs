//! What a host may look at and change on a board that drives nothing: any word, and the bits on which no torque
//! depends, to test a bare board before it gets an arm.
//!
//! Nothing here runs in a control tick.

#![allow(unsafe_code)] // registers by address

use painleve_shared::message::Probe;

/// Bits that a host may change, the same in every word of a range.
#[derive(Clone, Copy, Debug)]
pub struct SpareBits {
    /// Address of the first word.
    pub first: u32,
    /// Address of the last word.
    pub last: u32,
    /// The bits.
    pub mask: u32,
}

impl SpareBits {
    /// Bits of one word.
    pub const fn of_word(address: u32, mask: u32) -> Self {
        Self {
            first: address,
            last: address,
            mask,
        }
    }
}

/// The SysTick timer, which nothing uses: its exception is an unexpected one, and resets the chip.
pub const SYSTICK: SpareBits = SpareBits {
    first: 0xe000_e010,
    last: 0xe000_e018,
    mask: u32::MAX,
};

/// Carries out a probe; returns the word afterwards, `None` without a change if none of the bits to change are spare.
///
/// A load from an address that does not answer is a hard fault, which resets the chip.
#[inline(never)]
pub fn carry_out(probe: Probe, spare: &[SpareBits]) -> Option<u32> {
    let (address, value) = match probe {
        Probe::Load { address } => (address & !3, None),
        Probe::Store { address, value } => (address & !3, Some(value)),
    };
    let word = address as *mut u32;
    if let Some(value) = value {
        let bits = spare
            .iter()
            .find(|it| (it.first..=it.last).contains(&address))?;
        // SAFETY: a register of the board's list, in which no other code changes bits meanwhile on which a torque depends.
        unsafe {
            let kept = if bits.mask == u32::MAX {
                0
            } else {
                word.read_volatile() & !bits.mask
            };
            word.write_volatile(kept | value & bits.mask);
        }
    }
    // SAFETY: a load changes no variable; the handler of hard faults takes one that fails.
    Some(unsafe { word.read_volatile() })
}

//! The part of a flash that keeps configurations: what is erased is all ones, and stores only clear bits. The
//! power can fail in the middle of any operation.

use std::collections::BTreeSet;
use std::sync::Arc;

use crate::Picoseconds;

/// Keys that open the control register.
pub const CONTROL_KEYS: [u32; 2] = [0x4567_0123, 0xcdef_89ab];

/// Keys that open the option bytes.
pub const OPTION_KEYS: [u32; 2] = [0x0819_2a3b, 0x4c5d_6e7f];

/// Offset in a slot of a bit that cannot be erased.
const STUCK: usize = 40;

/// Content of the slots, and the operation under way.
#[derive(Clone, Debug)]
pub struct FlashSlots {
    /// Shared by snapshots until it changes.
    bytes: Arc<[u8]>,
    busy_until: Picoseconds,
    /// Duration of an erasure.
    pub erasure: Picoseconds,
    /// Operations until the power fails.
    operations_left: Option<u32>,
    /// Number of operations.
    pub operations: u32,
    /// Start of the range that the operation under way changes, and what was there before.
    changing: Option<(usize, Vec<u8>)>,
    /// Whether one bit cannot be erased, by a defect.
    pub has_stuck_bit: bool,
    /// Whether an erasure takes both slots, by a defect.
    pub erases_both: bool,
    /// Offsets of units that were changed in part and cannot be corrected.
    uncorrectable: BTreeSet<u32>,
}

/// Takes a key for a register that two keys open, of which `taken` have come; returns whether it opens now.
///
/// # Panics
/// If the key is wrong: the register then stays locked until a reset.
pub fn take_key(keys: [u32; 2], taken: &mut usize, key: u32) -> bool {
    assert_eq!(key, keys[*taken], "a wrong key locks the flash's register");
    *taken = (*taken + 1) % 2;
    *taken == 0
}

/// What an operation has come to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[must_use]
pub enum Power {
    /// It is under way.
    On,
    /// The power has failed in its middle.
    Failed,
}

impl FlashSlots {
    /// Creates erased slots, whose erasure takes this long.
    pub fn new(length: usize, erasure: Picoseconds) -> Self {
        Self {
            bytes: vec![0xff; length].into(),
            busy_until: 0,
            erasure,
            operations_left: None,
            operations: 0,
            changing: None,
            has_stuck_bit: false,
            erases_both: false,
            uncorrectable: BTreeSet::new(),
        }
    }

    /// Lets the power fail in the middle of the operation of this number from now, 0 for the next.
    pub fn fail_in(&mut self, operations: u32) {
        self.operations_left = Some(operations);
    }

    /// Returns whether an operation is under way.
    pub fn is_busy(&self, now: Picoseconds) -> bool {
        now < self.busy_until
    }

    /// Returns the content.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Changes the content, as a programmer would, or a defect.
    pub fn bytes_mut(&mut self) -> &mut [u8] {
        Arc::make_mut(&mut self.bytes)
    }

    /// Returns a word.
    pub fn word(&self, offset: u32) -> u32 {
        let at = offset as usize & !3;
        let word = self.bytes[at..at + 4].first_chunk();
        word.map_or(0, |it| u32::from_le_bytes(*it))
    }

    /// Returns whether the unit of eight bytes at this offset cannot be corrected.
    pub fn is_uncorrectable(&self, offset: u32) -> bool {
        self.uncorrectable.contains(&(offset & !7))
    }

    fn begin(&mut self, start: usize, length: usize, until: Picoseconds) -> Power {
        self.operations += 1;
        self.busy_until = until;
        self.changing = Some((start, self.bytes[start..start + length].to_vec()));
        match self.operations_left {
            Some(0) => {
                self.operations_left = None;
                Power::Failed
            }
            left => {
                self.operations_left = left.map(|it| it - 1);
                Power::On
            }
        }
    }

    /// Erases a range from now on.
    pub fn erase(&mut self, start: usize, length: usize, now: Picoseconds) -> Power {
        let power = self.begin(start, length, now + self.erasure);
        let range = start..start + length;
        let bytes = Arc::make_mut(&mut self.bytes);
        bytes[range.clone()].fill(0xff);
        if self.erases_both {
            bytes.fill(0xff);
        }
        if self.has_stuck_bit {
            bytes[start + STUCK] &= !1;
        }
        self.uncorrectable
            .retain(|it| !range.contains(&(*it as usize)));
        power
    }

    /// Clears the bits of a unit until `until`.
    pub fn program(&mut self, start: usize, unit: &[u8], until: Picoseconds) -> Power {
        let power = self.begin(start, unit.len(), until);
        let bytes = Arc::make_mut(&mut self.bytes);
        for (place, byte) in bytes[start..].iter_mut().zip(unit) {
            *place &= byte;
        }
        power
    }

    /// Ends an operation that a reset or a failure of the power interrupts: every other bit is as before, and no unit can
    /// be corrected.
    pub fn reset(&mut self, now: Picoseconds) {
        let interrupted = self.changing.take().filter(|_| self.is_busy(now));
        self.busy_until = 0;
        let Some((start, before)) = interrupted else {
            return;
        };
        let bytes = Arc::make_mut(&mut self.bytes);
        for (place, before) in bytes[start..].iter_mut().zip(&before) {
            *place ^= (*place ^ before) & 0x55;
        }
        let units = (start & !7..start + before.len()).step_by(8);
        self.uncorrectable.extend(units.map(|it| it as u32));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_reset_interrupts_is_half_done() {
        let mut slots = FlashSlots::new(24, 1);
        for start in [0, 8] {
            assert_eq!(slots.program(start, &[0; 8], 1), Power::On);
        }
        slots.reset(0);
        assert_eq!(slots.bytes()[..8], [0; 8]);
        assert_eq!(slots.bytes()[8..16], [0x55; 8]);
        assert!(!slots.is_uncorrectable(4) && slots.is_uncorrectable(12));
        slots.fail_in(0);
        assert_eq!(slots.erase(0, 16, 0), Power::Failed);
        slots.reset(0);
        assert_eq!(slots.bytes()[..8], [0xaa; 8]);
        assert_eq!(slots.bytes()[8..16], [0xff; 8]);
        assert!(slots.is_uncorrectable(4) && slots.is_uncorrectable(12));
        // One that has ended stays.
        assert_eq!(slots.program(16, &[0; 8], 1), Power::On);
        slots.reset(1);
        assert_eq!(slots.bytes()[16..], [0; 8]);
    }
}

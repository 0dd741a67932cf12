//! The part of a flash that keeps configurations: what is erased is all ones, and stores only clear bits. The
//! power can fail in the middle of any operation.

use std::collections::BTreeSet;
use std::sync::Arc;

use crate::{MILLISECOND, Picoseconds};

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
    /// Range that is being erased.
    erasing: Option<(usize, usize)>,
    /// Whether one bit cannot be erased, by a defect.
    pub has_stuck_bit: bool,
    /// Whether an erasure takes both slots, by a defect.
    pub erases_both: bool,
    /// Offsets of units that were written in part and cannot be corrected.
    uncorrectable: BTreeSet<u32>,
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
    /// Creates erased slots.
    pub fn new(length: usize) -> Self {
        Self {
            bytes: vec![0xff; length].into(),
            busy_until: 0,
            // Shorter than in any data sheet, so that tests need not wait.
            erasure: MILLISECOND,
            operations_left: None,
            operations: 0,
            erasing: None,
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

    fn begin(&mut self, until: Picoseconds) -> Power {
        self.operations += 1;
        match &mut self.operations_left {
            Some(0) => {
                self.operations_left = None;
                return Power::Failed;
            }
            Some(left) => *left -= 1,
            None => {}
        }
        self.busy_until = until;
        Power::On
    }

    /// Erases a range from now on; its second half stays if the power fails.
    pub fn erase(&mut self, start: usize, length: usize, now: Picoseconds) -> Power {
        let power = self.begin(now + self.erasure);
        self.erasing = Some((start, length));
        let erased = if power == Power::On {
            length
        } else {
            length / 2
        };
        Arc::make_mut(&mut self.bytes)[start..start + erased].fill(0xff);
        if self.erases_both {
            Arc::make_mut(&mut self.bytes).fill(0xff);
        }
        if self.has_stuck_bit {
            Arc::make_mut(&mut self.bytes)[start + STUCK] &= !1;
        }
        self.uncorrectable
            .retain(|it| !(start..start + erased).contains(&(*it as usize)));
        power
    }

    /// Clears the bits of a unit until `until`; half of it if the power fails.
    pub fn program(&mut self, start: usize, unit: &[u8], until: Picoseconds) -> Power {
        let power = self.begin(until);
        self.erasing = None;
        let written = if power == Power::On {
            unit.len()
        } else {
            self.uncorrectable.insert(start as u32 & !7);
            unit.len() / 2
        };
        let bytes = Arc::make_mut(&mut self.bytes);
        for (place, byte) in bytes[start..].iter_mut().zip(unit.iter().take(written)) {
            *place &= byte;
        }
        power
    }

    /// Ends an operation that a reset interrupts: what is being erased is neither erased nor what it was.
    pub fn reset(&mut self, now: Picoseconds) {
        if let Some((start, length)) = self.erasing.take().filter(|_| self.is_busy(now)) {
            Arc::make_mut(&mut self.bytes)[start + length / 2..start + length].fill(0x55);
        }
        self.busy_until = 0;
    }
}

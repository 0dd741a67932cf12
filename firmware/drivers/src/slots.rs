//! Keeps bytes in flash over a loss of power: two slots, of which a new version overwrites the older one.
//!
//! A slot begins with a header, which is written last: magic number, version, build, length and a CRC-32 over
//! all of it. Whenever power fails, a slot that has been erased or written in part fails its check, and the
//! other slot is still there. Flash is any [`NorFlash`].
//!
//! Nothing here is urgent: functions stay out of line to be small.
//!
//! `sequential-storage` stores several keys and spreads wear over many pages, which one configuration that
//! changes a few times a year does not need; and it is asynchronous. Two slots can be checked by cutting the
//! power at every operation.

use crc::{CRC_32_ISO_HDLC, Crc, Table};
use embedded_storage::nor_flash::NorFlash;

static CRC: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISO_HDLC);

/// Marks a written header.
const MAGIC: u32 = 0x5041_494e;

/// Length of a header, bytes: a multiple of every flash's smallest store.
const HEADER: usize = 32;

/// Largest unit of a store, bytes.
const UNIT: usize = 8;

/// The flash could not be erased or written, or its content is another one afterwards.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotWritten;

/// The newest intact content.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Content {
    /// Number of times that a content was stored.
    pub version: u32,
    /// The build that has stored it.
    pub build: u64,
    /// Its length, bytes.
    pub length: usize,
}

/// The two slots of a flash, which divide it into halves.
#[derive(Clone, Debug)]
pub struct Slots<F> {
    flash: F,
}

impl<F: NorFlash> Slots<F> {
    /// Takes ownership of the flash.
    pub const fn new(flash: F) -> Self {
        Self { flash }
    }

    #[cfg(test)]
    fn flash_mut(&mut self) -> &mut F {
        &mut self.flash
    }

    fn slot_length(&self) -> u32 {
        (self.flash.capacity() / 2) as u32
    }

    /// Reads the newest content into `buffer`; `None` if no slot is intact.
    #[inline(never)]
    pub fn newest(&mut self, buffer: &mut [u8]) -> Option<Content> {
        let (slot, _) = self.newest_slot(buffer)?;
        // The other slot may have been read last, and half-erased cells may read differently.
        self.read(slot, buffer)
    }

    /// Stores a content as the newest version, which it returns. `buffer` has room for the longest content.
    ///
    /// # Errors
    /// [`NotWritten`]; the newest content is then still there.
    #[inline(never)]
    pub fn store(
        &mut self,
        build: u64,
        content: &[u8],
        buffer: &mut [u8],
    ) -> Result<u32, NotWritten> {
        let newest = self.newest_slot(buffer);
        let slot = newest.map_or(0, |(slot, _)| 1 - slot);
        let version = newest.map_or(1, |(_, it)| it.version.wrapping_add(1));
        let length = u32::try_from(content.len()).map_err(|_| NotWritten)?;
        let start = slot * self.slot_length();
        if length as usize + HEADER + UNIT > self.slot_length() as usize {
            return Err(NotWritten);
        }
        self.erase(slot)?;
        let mut at = start + HEADER as u32;
        for unit in content.chunks(UNIT) {
            let mut padded = [u8::MAX; UNIT];
            padded
                .get_mut(..unit.len())
                .ok_or(NotWritten)?
                .copy_from_slice(unit);
            self.flash.write(at, &padded).map_err(|_| NotWritten)?;
            at += UNIT as u32;
        }
        let header = header(version, build, length, content);
        self.flash.write(start, &header).map_err(|_| NotWritten)?;
        match self.read(slot, buffer) {
            Some(written) if written.version == version => Ok(version),
            _ => Err(NotWritten),
        }
    }

    /// Erases both slots, the older one first.
    ///
    /// # Errors
    /// [`NotWritten`] if a slot could not be erased.
    #[inline(never)]
    pub fn forget(&mut self, buffer: &mut [u8]) -> Result<(), NotWritten> {
        let newest = self.newest_slot(buffer).map_or(0, |(slot, _)| slot);
        self.erase(1 - newest)?;
        self.erase(newest)?;
        match self.newest_slot(buffer) {
            None => Ok(()),
            Some(_) => Err(NotWritten),
        }
    }

    #[inline(never)]
    fn erase(&mut self, slot: u32) -> Result<(), NotWritten> {
        let length = self.slot_length();
        self.flash
            .erase(slot * length, (slot + 1) * length)
            .map_err(|_| NotWritten)
    }

    #[inline(never)]
    fn newest_slot(&mut self, buffer: &mut [u8]) -> Option<(u32, Content)> {
        let contents = [self.read(0, buffer), self.read(1, buffer)];
        match contents {
            [Some(first), Some(second)] => {
                let is_newer = second.version.wrapping_sub(first.version) < u32::MAX / 2;
                Some(if is_newer { (1, second) } else { (0, first) })
            }
            [Some(first), None] => Some((0, first)),
            [None, Some(second)] => Some((1, second)),
            [None, None] => None,
        }
    }

    /// Reads a slot; `None` if it is not intact, or longer than the buffer.
    #[inline(never)]
    fn read(&mut self, slot: u32, buffer: &mut [u8]) -> Option<Content> {
        let start = slot * self.slot_length();
        let mut found = [0; HEADER];
        self.flash.read(start, &mut found).ok()?;
        let (words, _) = found.as_chunks::<4>();
        let [magic, version, low, high, length, ..] = words else {
            return None;
        };
        let [magic, version, low, high, length] =
            [magic, version, low, high, length].map(|it| u32::from_le_bytes(*it));
        if magic != MAGIC {
            return None;
        }
        let content = buffer.get_mut(..length as usize)?;
        self.flash.read(start + HEADER as u32, content).ok()?;
        let build = u64::from(high) << 32 | u64::from(low);
        (header(version, build, length, content) == found).then_some(Content {
            version,
            build,
            length: length as usize,
        })
    }
}

/// Returns the header of a content.
#[inline(never)]
fn header(version: u32, build: u64, length: u32, content: &[u8]) -> [u8; HEADER] {
    let [low, high] = [build as u32, (build >> 32) as u32];
    let mut digest = CRC.digest();
    for word in [version, low, high, length] {
        digest.update(&word.to_le_bytes());
    }
    digest.update(content);
    let words = [MAGIC, version, low, high, length, digest.finalize()];
    let mut header = [u8::MAX; HEADER];
    for (place, word) in header.as_chunks_mut::<4>().0.iter_mut().zip(words) {
        *place = word.to_le_bytes();
    }
    header
}

#[cfg(test)]
mod tests {
    use core::convert::Infallible;

    use embedded_storage::nor_flash::{ErrorType, ReadNorFlash};
    use proptest::prelude::*;

    use super::*;

    const SLOT: usize = 256;

    /// Flash whose power fails after a number of bytes have been erased or written.
    #[derive(Clone)]
    struct Memory {
        bytes: [u8; 2 * SLOT],
        left: usize,
    }

    impl Memory {
        fn change(&mut self, at: usize, value: u8) {
            if self.left > 0 {
                self.left -= 1;
                self.bytes[at] = value;
            }
        }
    }

    impl ErrorType for Memory {
        type Error = Infallible;
    }

    impl ReadNorFlash for Memory {
        const READ_SIZE: usize = 1;

        fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Infallible> {
            let start = offset as usize;
            bytes.copy_from_slice(&self.bytes[start..start + bytes.len()]);
            Ok(())
        }

        fn capacity(&self) -> usize {
            self.bytes.len()
        }
    }

    impl NorFlash for Memory {
        const WRITE_SIZE: usize = UNIT;
        const ERASE_SIZE: usize = SLOT;

        fn erase(&mut self, from: u32, to: u32) -> Result<(), Infallible> {
            for at in from..to {
                self.change(at as usize, 0xff);
            }
            Ok(())
        }

        fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Infallible> {
            for (n, byte) in bytes.iter().enumerate() {
                let at = offset as usize + n;
                self.change(at, self.bytes[at] & byte);
            }
            Ok(())
        }
    }

    fn content(slots: &mut Slots<Memory>) -> Option<(Content, std::vec::Vec<u8>)> {
        let mut buffer = [0; SLOT];
        let found = slots.newest(&mut buffer)?;
        Some((found, buffer[..found.length].to_vec()))
    }

    proptest! {
        #[test]
        fn whenever_power_fails_the_old_content_or_the_new_one_is_intact(
            old in proptest::collection::vec(any::<u8>(), 0..200),
            new in proptest::collection::vec(any::<u8>(), 0..200),
            garbage in any::<u8>(),
            stored_before in 1..4_u32,
        ) {
            let mut buffer = [0; SLOT];
            let memory = Memory { bytes: [garbage; 2 * SLOT], left: usize::MAX };
            let mut slots = Slots::new(memory);
            prop_assert_eq!(content(&mut slots), None);
            for version in 1..=stored_before {
                prop_assert_eq!(slots.store(7, &old, &mut buffer), Ok(version));
            }
            for left in 0..SLOT + HEADER + new.len() + UNIT {
                let mut cut = slots.clone();
                cut.flash_mut().left = left;
                let stored = cut.store(8, &new, &mut buffer);
                cut.flash_mut().left = usize::MAX;
                let (found, bytes) = content(&mut cut).expect("an intact slot");
                if found.version == stored_before {
                    prop_assert_eq!((found.build, &bytes), (7, &old));
                    prop_assert_eq!(stored, Err(NotWritten));
                } else {
                    prop_assert_eq!((found.version, found.build), (stored_before + 1, 8));
                    prop_assert_eq!(&bytes, &new);
                }
                // The next one is stored as usual.
                let next = cut.store(9, &new, &mut buffer);
                prop_assert_eq!(next, Ok(found.version + 1));
            }
        }
    }

    #[test]
    fn a_version_after_the_last_is_newer() {
        let mut buffer = [0; SLOT];
        let memory = Memory {
            bytes: [0xff; 2 * SLOT],
            left: usize::MAX,
        };
        let mut slots = Slots::new(memory);
        let header = header(u32::MAX, 1, 0, &[]);
        slots.flash_mut().bytes[..HEADER].copy_from_slice(&header);
        assert_eq!(slots.store(1, &[5], &mut buffer), Ok(0));
        assert_eq!(
            content(&mut slots).map(|(it, bytes)| (it.version, bytes)),
            Some((0, std::vec![5]))
        );
    }

    #[test]
    fn what_was_forgotten_is_gone_and_what_is_too_long_is_not_stored() {
        let mut buffer = [0; SLOT];
        let memory = Memory {
            bytes: [0xff; 2 * SLOT],
            left: usize::MAX,
        };
        let mut slots = Slots::new(memory);
        assert_eq!(slots.store(1, &[1; 100], &mut buffer), Ok(1));
        assert_eq!(slots.store(1, &[2; 250], &mut buffer), Err(NotWritten));
        assert_eq!(
            content(&mut slots).map(|(it, _)| (it.version, it.length)),
            Some((1, 100))
        );
        assert_eq!(slots.forget(&mut buffer), Ok(()));
        assert_eq!(content(&mut slots), None);
    }
}

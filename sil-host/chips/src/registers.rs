//! Registers and bits that a chip has, by tables that others made from its manufacturer's (`registers.py`). An image that
//! accesses others is in error, whatever our own models make of it.

use std::collections::BTreeMap;

use crate::bit_band::{AliasedBit, bit_band};

/// The registers of the peripherals in use: bits, and the value after a reset, by address.
#[derive(Clone, Debug)]
pub struct Registers(BTreeMap<u32, (u32, u32)>);

impl Registers {
    /// Parses a table: in each line a peripheral's name, address, and of its registers `offset=bits`, or
    /// `offset=bits:value` if a reset leaves another value than 0.
    pub fn parse(table: &str) -> Self {
        let number = |text: &str| u32::from_str_radix(text, 16).ok();
        let registers = table.lines().flat_map(|line| {
            let mut words = line.split(' ').skip(1);
            let base = words.next().and_then(number).unwrap_or_default();
            words.filter_map(move |word| {
                let (offset, bits) = word.split_once('=')?;
                let (bits, value) = bits.split_once(':').unwrap_or((bits, "0"));
                Some((base + number(offset)?, (number(bits)?, number(value)?)))
            })
        });
        Self(registers.collect())
    }

    /// Returns the addresses of all registers, with their values after a reset.
    pub fn after_reset(&self) -> impl Iterator<Item = (u32, u32)> {
        self.0
            .iter()
            .map(|(address, (_, value))| (*address, *value))
    }

    /// Returns what a store of `size` bytes brings to a register: the bridges of the peripherals' slow buses (APB) repeat a
    /// byte or a half word, so that it changes the whole register.
    ///
    /// # Panics
    /// If a narrow store goes to another bus, or not to the beginning of a register.
    pub fn on_the_bus(&self, address: u32, size: u32, value: u32) -> u32 {
        const SLOW: std::ops::Range<u32> = 0x4000_0000..0x4002_0000;
        let repeated = match size {
            1 => (value & 0xff) * 0x0101_0101,
            2 => (value & 0xffff) * 0x0001_0001,
            _ => return value,
        };
        let (bits, _) = self.0.get(&address).copied().unwrap_or_default();
        assert!(
            bits != 0 && SLOW.contains(&address),
            "store of {size} bytes to {address:#010x}"
        );
        repeated & bits
    }

    /// Checks a load or, with a value, a store of `size` bytes.
    ///
    /// # Panics
    /// If the chip has no such register, or no such bits in it.
    pub fn check(&self, address: u32, size: u32, stored: Option<u32>) {
        let (word, width, shift) = match bit_band(address) {
            Some(AliasedBit { word, bit }) => (word, 1, bit),
            None => (address & !3, 8 * size, 8 * (address & 3)),
        };
        let Some((bits, _)) = self.0.get(&word) else {
            panic!("there is no register at {address:#010x}");
        };
        let low = |bits: u32| u32::MAX >> (32 - bits);
        let value = (stored.unwrap_or(0) & low(width)) << shift;
        assert!(
            value & !bits == 0,
            "{value:#x} is stored to {word:#010x}, which has only the bits {bits:#x}"
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::panic::catch_unwind;

    #[test]
    fn what_a_chip_does_not_have_is_refused() {
        let registers = Registers::parse("# source\nWWDG 40002c00 0=ff:7f 4=3ff\n");
        let is_refused = |address, size, stored| {
            catch_unwind(|| registers.check(address, size, stored)).is_err()
        };
        assert!(!is_refused(0x4000_2c00, 4, None));
        assert!(!is_refused(0x4000_2c04, 4, Some(0x3ff)));
        assert!(!is_refused(0x4000_2c05, 1, Some(3)));
        assert!(is_refused(0x4000_2c05, 1, Some(4)));
        assert!(is_refused(0x4000_2c04, 4, Some(0x400)));
        assert!(is_refused(0x4000_2c08, 4, None));
        // Bits 7 and 8 of the first register in the bit-band alias.
        let bit = |bit: u32| 0x4200_0000 + 0x2c00 * 32 + 4 * bit;
        assert!(!is_refused(bit(7), 4, Some(1)));
        assert!(is_refused(bit(8), 4, Some(1)));
    }
}

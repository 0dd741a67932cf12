//! The memory protection unit (ARMv7-M Architecture Reference Manual, section B3.5), for privileged programs.

/// Bits of a permission.
pub const READ: u32 = 1;
/// Stores.
pub const WRITE: u32 = 2;
/// Instructions.
pub const EXECUTE: u32 = 4;

/// All of them.
pub const EVERYTHING: u32 = READ | WRITE | EXECUTE;

/// Bits of the control register.
const ENABLED: u32 = 1;
const IN_FAULTS: u32 = 2;
const DEFAULT_ELSEWHERE: u32 = 4;

/// Registers of the unit.
#[derive(Clone, Debug, Default)]
pub struct Protection {
    control: u32,
    number: u32,
    /// Base address and attributes.
    regions: [(u32, u32); 8],
}

impl Protection {
    /// Handles a load.
    pub fn read(&self, address: u32) -> u32 {
        let (base, attributes) = self.regions[self.number as usize];
        match address {
            0xe000_ed90 => (self.regions.len() as u32) << 8,
            0xe000_ed94 => self.control,
            0xe000_ed98 => self.number,
            0xe000_ed9c => base | self.number,
            _ => attributes,
        }
    }

    /// Handles a store.
    ///
    /// # Panics
    /// If a region is not as the unit demands.
    pub fn write(&mut self, address: u32, value: u32) {
        assert!(
            self.control & ENABLED == 0 || address == 0xe000_ed94,
            "a region changes while it counts"
        );
        match address {
            0xe000_ed94 => self.control = value,
            0xe000_ed98 => self.number = value & 7,
            0xe000_ed9c => {
                assert_eq!(value & 0x1f, 0, "the number of a region in its address");
                self.regions[self.number as usize].0 = value;
            }
            _ => {
                let base = self.regions[self.number as usize].0;
                let length = Self::length(value);
                assert!(length >= 256, "a region of {length} bytes");
                assert_eq!(u64::from(base) % length, 0, "a region at {base:#010x}");
                self.regions[self.number as usize].1 = value;
            }
        }
    }

    fn length(attributes: u32) -> u64 {
        2 << (attributes >> 1 & 0x1f)
    }

    /// Returns what may be done at an address at this priority; negative ones are those of faults.
    pub fn permits(&self, address: u32, priority: i32) -> u32 {
        let counts = priority >= 0 || self.control & IN_FAULTS != 0;
        if self.control & ENABLED == 0 || !counts {
            return EVERYTHING;
        }
        let region = self.regions.iter().rev().find(|(base, attributes)| {
            let length = Self::length(*attributes);
            let offset = u64::from(address.wrapping_sub(*base));
            attributes & 1 != 0
                && offset < length
                && attributes >> (8 + offset / (length / 8)) & 1 == 0
        });
        let Some((_, attributes)) = region else {
            let is_default = self.control & DEFAULT_ELSEWHERE != 0;
            return if is_default { EVERYTHING } else { 0 };
        };
        let access = match attributes >> 24 & 7 {
            0 | 4 => return 0,
            1..=3 => READ | WRITE,
            _ => READ,
        };
        let is_executable = attributes >> 28 & 1 == 0;
        access | if is_executable { EXECUTE } else { 0 }
    }
}

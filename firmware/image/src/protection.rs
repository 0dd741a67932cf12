//! The memory protection unit (ARMv7-M Architecture Reference Manual, section B3.5): code cannot be changed, data cannot
//! be executed, and a stack that overflows is a hard fault.
//!
//! Memory without a region keeps its default. The handlers of hard faults and of the non-maskable interrupt run
//! without protection.

#![allow(unsafe_code)] // the unit's registers

use cortex_m::peripheral::MPU;

/// What a region may be used for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Nothing.
    None,
    /// Constants and code.
    ReadExecute,
    /// Constants.
    Read,
    /// Variables.
    ReadWrite,
}

impl Access {
    /// Returns the fields XN and AP of the attributes.
    const fn bits(self) -> u32 {
        const NO_EXECUTION: u32 = 1 << 28;
        match self {
            Self::None => NO_EXECUTION,
            Self::ReadExecute => 0b110 << 24,
            Self::Read => NO_EXECUTION | 0b110 << 24,
            Self::ReadWrite => NO_EXECUTION | 0b011 << 24,
        }
    }
}

/// A region of the memory.
#[derive(Clone, Copy, Debug)]
pub struct Region {
    /// First address, a multiple of the length.
    pub start: u32,
    /// Length, a power of two from 256 bytes.
    pub length: u32,
    /// Eighths that do not belong to the region, one bit each.
    pub without: u8,
    /// What it may be used for.
    pub access: Access,
}

/// Starts the protection. Where regions overlap, the last one counts.
pub fn start(unit: &MPU, regions: &[Region]) {
    const ENABLED: u32 = 1;
    const DEFAULT_ELSEWHERE: u32 = 1 << 2;
    // Normal memory that no other master of the bus has to see at once.
    const CACHEABLE: u32 = 1 << 17;
    for (number, region) in (0..).zip(regions) {
        let size = region.length.trailing_zeros() - 1;
        // SAFETY: the fields of a region; the unit is not enabled yet.
        unsafe {
            unit.rnr.write(number);
            unit.rbar.write(region.start);
            let shape = u32::from(region.without) << 8 | size << 1 | ENABLED;
            unit.rasr.write(region.access.bits() | CACHEABLE | shape);
        }
    }
    // SAFETY: the regions permit what the program does.
    unsafe { unit.ctrl.write(DEFAULT_ELSEWHERE | ENABLED) };
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
}

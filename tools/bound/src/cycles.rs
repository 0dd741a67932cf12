//! The cycle model: the cost of an instruction on a Cortex-M4F, and what the chip around it adds.
//!
//! Silicon has not been measured. Every number has its source:
//!
//! - TRM: ARM, *Cortex-M4 Technical Reference Manual* r0p1 (DDI 0439D), table 3-1 (instructions),
//!   section 3.9 (exceptions) and table 7-1 (floating point);
//! - RM0090: ST, *STM32F405/415 … reference manual*, sections 2 (buses), 3.5 (flash) and 9.2.1 (memory mapped to address 0);
//! - RM0440: ST, *STM32G4 series … reference manual*, chapters "Embedded flash memory" and "System and memory overview".
//!
//! Where a table gives a range, the model takes its upper end. It never assumes predicted branches, folded
//! instructions, a hit in a cache or a prefetch in time. Loads and stores overlap with their neighbours only where TRM section 3.3.2
//! says that they do ([`Overlap`](crate::instruction::Overlap)). A load is charged as one from the program, unless
//! its address is known to be elsewhere ([`values`](crate::values)). The model does assume that no other bus master uses the
//! memory of the variables at the same time, and that addresses are aligned. The interrupts compute no address of a
//! peripheral but those of the pins that select the sensors; their ports are on a bus that runs at the core's clock
//! and does not wait (RM0090, sections 2.1 and 8.1). A test compares this with the addresses that executed interrupts access.

use core::ops::Range;

/// A chip: its memories, buses and clocks.
#[derive(Debug)]
pub struct Chip {
    /// Name.
    pub name: &'static str,
    /// Clock of the core, Hz.
    pub core_hz: f64,
    /// Clocks of the buses of encoders and force cell (`firmware/boards`), Hz.
    pub bus_hz: [f64; 2],
    /// Addresses of the program, if it is in RAM.
    program_in_ram: Range<u32>,
    /// Addresses of variables and stack.
    data: Range<u32>,
    /// Wait states of the flash.
    pub flash_wait_states: u32,
    /// Bytes of one read of the flash.
    pub flash_line_bytes: u32,
    /// Longest wait of an access to a peripheral: a transfer takes two cycles of its bus, after up to one for
    /// synchronisation (AMBA APB protocol, IHI 0024, section 3.1).
    pub peripheral_wait: u32,
}

/// The program runs from SRAM1, mapped to address 0. Five wait states of the flash: RM0090, table 10, 168 MHz at
/// 2.7 … 3.6 V; lines of 128 bits. The slower bus, APB1, runs at a quarter of the core's clock.
pub const F405: Chip = Chip {
    name: "STM32F405",
    core_hz: 168e6,
    bus_hz: [5_250_000.0, 1_312_500.0],
    program_in_ram: 0..0x0001_c000,
    data: 0x2001_c000..0x2002_0000,
    flash_wait_states: 5,
    flash_line_bytes: 16,
    peripheral_wait: 12,
};

/// The program runs from flash, of four wait states (RM0440: "Read access latency", 170 MHz in range 1 boost mode), which
/// gives 64 bits at once with two banks. All buses run at the core's clock.
pub const G474: Chip = Chip {
    name: "STM32G474",
    core_hz: 170e6,
    bus_hz: [170e6 / 32.0, 170e6 / 128.0],
    program_in_ram: 0..0,
    data: 0x2000_0000..0x2002_0000,
    flash_wait_states: 4,
    flash_line_bytes: 8,
    peripheral_wait: 3,
};

/// Refill of the pipeline after a branch, P in TRM table 3-1: one to three.
pub const PIPELINE_REFILL: u32 = 3;

/// Delay of a load or store whose address depends on the result of the data-processing instruction before it
/// (TRM, section 3.3.2).
pub const ADDRESS_STALL: u32 = 1;

/// Cycles of a floating-point division or square root after its first, during which integer instructions
/// are executed (TRM, note to table 7-1).
pub const FLOAT_DIVIDE_REST: u32 = 13;

/// Longest wait of a load of a constant from the program in RAM: its bus and that of the instructions
/// take turns (RM0090, section 2.1.8), which delays the load and the next instruction by a cycle each.
const PROGRAM_DATA_WAIT: u32 = 2;

/// Addresses of the flash, of either chip.
const FLASH: Range<u32> = 0x0800_0000..0x1000_0000;

/// Addresses of peripherals.
const PERIPHERALS: Range<u32> = 0x4000_0000..0xa000_0000;

impl Chip {
    /// Returns the chip whose program contains this address.
    pub fn of_program(address: u32) -> Option<&'static Self> {
        if F405.program_in_ram.contains(&address) {
            Some(&F405)
        } else {
            FLASH.contains(&address).then_some(&G474)
        }
    }

    /// Returns the time of these cycles, µs.
    pub fn microseconds(&self, cycles: u32) -> f64 {
        f64::from(cycles) / self.core_hz * 1e6
    }

    /// Returns whether instructions at this address are read from flash.
    pub fn is_in_flash(&self, address: u32) -> bool {
        !self.program_in_ram.contains(&address)
    }

    /// Returns whether variables and stack are at this address.
    pub fn is_data(&self, address: u32) -> bool {
        self.data.contains(&address)
    }

    /// Returns whether a memory or a peripheral is at this address.
    pub fn is_memory(&self, address: u32) -> bool {
        self.is_data(address)
            || self.program_in_ram.contains(&address)
            || FLASH.contains(&address)
            || self.is_peripheral(address)
    }

    /// Returns whether a peripheral is at this address.
    pub fn is_peripheral(&self, address: u32) -> bool {
        PERIPHERALS.contains(&address)
    }

    /// Longest wait of a load from flash: the end of another read, then its own.
    fn flash_data_wait(&self) -> u32 {
        2 * (self.flash_wait_states + 1)
    }

    /// Returns the longest wait for an instruction that does not follow the last one: in flash the end of the read of the line
    /// after that one, then its own.
    pub fn fetch_wait(&self, address: u32) -> u32 {
        if self.is_in_flash(address) {
            self.flash_wait_states + 1 + self.flash_wait_states
        } else {
            0
        }
    }

    /// Returns the longest wait for a word of the program that is loaded as data.
    pub fn program_wait(&self) -> u32 {
        if self.program_in_ram.is_empty() {
            self.flash_data_wait()
        } else {
            PROGRAM_DATA_WAIT
        }
    }

    /// Returns the longest wait of a load or store of a word at a known address.
    pub fn data_wait(&self, address: u32) -> u32 {
        if FLASH.contains(&address) {
            self.flash_data_wait()
        } else if self.program_in_ram.contains(&address) {
            PROGRAM_DATA_WAIT
        } else if self.is_peripheral(address) {
            self.peripheral_wait
        } else {
            0
        }
    }

    /// Returns the cost of a taken branch beyond its own cycle.
    pub fn branch(&self, target: u32) -> u32 {
        PIPELINE_REFILL + self.fetch_wait(target)
    }

    /// Returns the cycles around an interrupt's handler. From the request to the first instruction, TRM
    /// section 3.9.1: 12, plus the read of the vector and the wait for the first instruction. To
    /// return: 12, plus the wait for an instruction. A handler that uses the floating-point unit
    /// saves s0 … s15 and FPSCR, 17 stores and one cycle to begin (TRM, section 7.2.2 and table 7-1, VSTM),
    /// and loads them again, 17. To align the stack pointer, the core leaves a word of the stack out (CCR.STKALIGN), which
    /// transfers nothing.
    pub fn around(&self, handler: u32, uses_float: bool) -> u32 {
        let entry = 12 + self.flash_data_wait() + self.fetch_wait(handler);
        let exit = 12 + self.fetch_wait(handler);
        let float = if uses_float { 18 + 17 } else { 0 };
        entry + exit + float
    }
}

/// Kinds of instruction with different costs, with the number of registers where it matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InstructionKind {
    /// One cycle: arithmetic, logic, moves, 32-bit and long multiplication, IT.
    Simple,
    /// Integer division: 2 … 12.
    Divide,
    /// Load of this number of words: one cycle for the address, one per word.
    Load(u32),
    /// Store of this number of words.
    Store(u32),
    /// Barrier that waits for memory accesses or the pipeline; ISB refills the pipeline.
    Barrier,
    /// Access to a special register: 1, or 2 for the interrupt masks.
    Special,
    /// Table branch: two cycles for the load, one for the addition (TRM, section 3.3.2), then the refill.
    TableBranch,
    /// Branch; its refill is counted when it is taken.
    Branch,
    /// Floating-point addition, multiplication, comparison, conversion, move: 1, plus one if the
    /// next instruction uses the result.
    Float,
    /// Floating-point multiplication and addition: 3.
    FloatMultiplyAdd,
    /// Move between two core registers and two floating-point registers: 2.
    FloatPair,
    /// Floating-point division or square root: 14 ([`FLOAT_DIVIDE_REST`]), plus one if the next
    /// instruction uses the result.
    FloatDivide,
    /// Not known: what contains it has no bound.
    Unknown,
}

impl InstructionKind {
    /// Returns the cycles without wait states, excluding the refill of a branch and the rest of a
    /// floating-point division.
    pub fn cycles(self) -> u32 {
        match self {
            Self::Simple | Self::Branch | Self::Float => 1,
            Self::Divide => 12,
            Self::Load(words) | Self::Store(words) => 1 + words,
            Self::Barrier => 1 + PIPELINE_REFILL,
            Self::Special => 2,
            Self::FloatPair => 2,
            Self::TableBranch | Self::FloatMultiplyAdd => 3,
            Self::FloatDivide | Self::Unknown => 1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_shows_its_chip_by_where_it_begins() {
        let chip = |start| Chip::of_program(start).map(|it| it.name);
        assert_eq!(chip(0x0000_0400), Some("STM32F405"));
        assert_eq!(chip(0x0800_0000), Some("STM32G474"));
        // A program of Linux, and one of an STM32 in its RAM.
        assert_eq!([0x0040_0000, 0x2000_0000].map(chip), [None; 2]);
    }
}

//! The cycle model: the cost of an instruction on the Cortex-M4F of an STM32F405, which runs from flash
//! or from RAM.
//!
//! Silicon has not been measured. Every number has its source:
//!
//! - TRM: ARM, *Cortex-M4 Technical Reference Manual* r0p1 (DDI 0439D), table 3-1 (instructions),
//!   section 3.9 (exceptions) and table 7-1 (floating point);
//! - RM0090: ST, *STM32F405/415 … reference manual*, section 3.5 (flash accelerator), section 2
//!   (buses) and section 9.2.1 (memory mapped to address 0).
//!
//! Where a table gives a range, the model takes its upper end. It never assumes predicted branches or
//! folded instructions. Loads and stores overlap with their neighbours only where TRM section 3.3.2 says that they do
//! ([`Overlap`](crate::instruction::Overlap)). The model does assume that data lies in RAM other than
//! the program's, which no other bus master uses at the same time, unless the address is a constant
//! in flash, in the program or in a peripheral; and that addresses are aligned. The interrupts compute no address of a
//! peripheral but those of the pins that select the sensors; their ports are on the bus AHB1, which runs at the core's clock
//! and does not wait (RM0090, sections 2.1 and 8.1). A test compares this with the addresses that executed interrupts access.

/// Wait states of the flash: RM0090, table 10, 168 MHz at 2.7 … 3.6 V.
pub const FLASH_WAIT_STATES: u32 = 5;

/// Cycles of one read of a flash line.
pub const FLASH_READ: u32 = FLASH_WAIT_STATES + 1;

/// Bytes of a flash line: 128 bits (RM0090, section 3.5.2).
pub const FLASH_LINE_BYTES: u32 = 16;

/// Lines of the instruction cache (RM0090, section 3.5.2).
pub const INSTRUCTION_CACHE_LINES: usize = 64;

/// Refill of the pipeline after a branch, P in TRM table 3-1: one to three.
pub const PIPELINE_REFILL: u32 = 3;

/// Delay of a load or store whose address depends on the result of the data-processing instruction before it
/// (TRM, section 3.3.2).
pub const ADDRESS_STALL: u32 = 1;

/// Cycles of a floating-point division or square root after its first, during which integer instructions
/// are executed (TRM, note to table 7-1).
pub const FLOAT_DIVIDE_REST: u32 = 13;

/// Longest wait of a load of a constant from flash: the end of an instruction line's read, then its
/// own.
pub const FLASH_DATA_WAIT: u32 = 2 * FLASH_READ;

/// Longest wait of a load of a constant from the program in RAM: its bus and that of the instructions
/// take turns (RM0090, section 2.1.8), which delays the load and the next instruction by a cycle each.
pub const PROGRAM_DATA_WAIT: u32 = 2;

/// Longest wait of an access to a peripheral. The slower bus, APB1, runs at a quarter of the core's
/// clock; a transfer takes two of its cycles, after up to one for synchronisation (AMBA APB
/// protocol, IHI 0024, section 3.1).
pub const PERIPHERAL_WAIT: u32 = 12;

/// Addresses of the program in RAM: SRAM1, mapped to 0.
const PROGRAM_IN_RAM: core::ops::Range<u32> = 0..0x0001_c000;

/// Addresses of the flash.
const FLASH: core::ops::Range<u32> = 0x0800_0000..0x1000_0000;

/// Addresses of peripherals.
const PERIPHERALS: core::ops::Range<u32> = 0x4000_0000..0xa000_0000;

/// Returns whether instructions at this address are read from flash.
pub fn is_in_flash(address: u32) -> bool {
    !PROGRAM_IN_RAM.contains(&address)
}

/// Returns the longest wait for an instruction that does not follow the last one.
pub fn fetch_wait(address: u32) -> u32 {
    if is_in_flash(address) {
        FLASH_WAIT_STATES
    } else {
        0
    }
}

/// Returns the longest wait of a load or store at a known address.
pub fn data_wait(address: u32) -> u32 {
    if FLASH.contains(&address) {
        FLASH_DATA_WAIT
    } else if PROGRAM_IN_RAM.contains(&address) {
        PROGRAM_DATA_WAIT
    } else if PERIPHERALS.contains(&address) {
        PERIPHERAL_WAIT
    } else {
        0
    }
}

/// Returns the cycles around an interrupt's handler. From the request to the first instruction, TRM
/// section 3.9.1: 12, plus the read of the vector from flash and the wait for the first instruction. To
/// return: 12, plus the wait for an instruction from flash. A handler that uses the floating-point unit
/// saves s0 … s15 and FPSCR, 17 stores and one cycle to begin (TRM, section 7.2.2 and table 7-1, VSTM),
/// and loads them again, 17. To align the stack pointer, the core leaves a word of the stack out (CCR.STKALIGN), which
/// transfers nothing.
pub fn around(handler: u32, uses_float: bool) -> u32 {
    let entry = 12 + FLASH_READ + fetch_wait(handler);
    let exit = 12 + FLASH_READ;
    let float = if uses_float { 18 + 17 } else { 0 };
    entry + exit + float
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
            Self::FloatDivide => 1,
        }
    }
}

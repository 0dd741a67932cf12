//! The cycle model: what an instruction costs a Cortex-M4F that runs from the flash of an STM32F405.
//!
//! Silicon has not been measured. Every number has its source:
//!
//! - TRM: ARM, *Cortex-M4 Technical Reference Manual* r0p1 (DDI 0439D), table 3-1 (instructions),
//!   section 3.9 (exceptions) and table 7-1 (floating point);
//! - RM0090: ST, *STM32F405/415 … reference manual*, section 3.5 (flash accelerator) and
//!   section 2 (buses).
//!
//! Where a table gives a range the model takes its upper end, and it never counts two loads or
//! stores as pipelined, a branch as predicted or an instruction as folded. What it does take for
//! granted: data lies in SRAM, which no other bus master uses at the same time, unless the address
//! is a constant of flash or of a peripheral.

/// Cycles of the flash beyond the first: RM0090, table 10, 168 MHz at 2.7 … 3.6 V.
pub const FLASH_WAIT_STATES: u32 = 5;

/// Cycles of one read of a flash line.
pub const FLASH_READ: u32 = FLASH_WAIT_STATES + 1;

/// Bytes of a flash line: 128 bits (RM0090, section 3.5.2).
pub const FLASH_LINE_BYTES: u32 = 16;

/// Lines of the instruction cache (RM0090, section 3.5.2).
pub const INSTRUCTION_CACHE_LINES: usize = 64;

/// Refill of the pipeline after a branch, P in TRM table 3-1: one to three.
pub const PIPELINE_REFILL: u32 = 3;

/// What a load of a constant from flash waits for at most: a line being read for the instructions,
/// then its own.
pub const FLASH_DATA_WAIT: u32 = 2 * FLASH_READ;

/// What an access to a peripheral waits for at most. The slower bus, APB1, runs at a quarter of the
/// core's clock; a transfer takes two of its cycles after up to one to meet them (AMBA APB protocol,
/// IHI 0024, section 3.1).
pub const PERIPHERAL_WAIT: u32 = 12;

/// From the interrupt's request to its first instruction, TRM section 3.9.1: 12 cycles at zero wait,
/// with the vector and the first line read from flash.
pub const EXCEPTION_ENTRY: u32 = 12 + 2 * FLASH_READ;

/// Saving of s0 … s15 and FPSCR when the handler first uses the floating-point unit: 17 stores and
/// one cycle to begin (TRM, section 7.2.2 and table 7-1, VSTM).
pub const LAZY_FLOAT_STACKING: u32 = 18;

/// Return to what was interrupted, TRM section 3.9.1: 12 cycles, 17 more for the floating-point state,
/// and the line it goes on with.
pub const EXCEPTION_EXIT: u32 = 12 + 17 + FLASH_READ;

/// Kinds of instruction that differ in cost, with the number of registers where that matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InstructionKind {
    /// One cycle: arithmetic, logic, moves, 32-bit and long multiplication, IT.
    Simple,
    /// Integer division: 2 … 12.
    Divide,
    /// Loads of so many words: one cycle for the address, one a word.
    Load(u32),
    /// Stores of so many words.
    Store(u32),
    /// Waits until memory accesses or the pipeline are done; ISB refills the pipeline.
    Barrier,
    /// Reads or writes a special register: 1, or 2 with the masks of interrupts.
    Special,
    /// Table branch: the load of the table and the refill.
    TableBranch,
    /// A branch; its refill is counted where it is taken.
    Branch,
    /// Floating-point addition, multiplication, comparison, conversion, move: 1, and one more if the
    /// next instruction uses the result.
    Float,
    /// Floating-point multiplication and addition: 3.
    FloatMultiplyAdd,
    /// Floating-point division or square root: 14.
    FloatDivide,
}

impl InstructionKind {
    /// Cycles at zero wait, without the refill of a branch.
    pub fn cycles(self) -> u32 {
        match self {
            Self::Simple | Self::Branch | Self::Float => 1,
            Self::Divide => 12,
            Self::Load(words) | Self::Store(words) => 1 + words,
            Self::Barrier => 1 + PIPELINE_REFILL,
            Self::Special => 2,
            Self::TableBranch => 2,
            Self::FloatMultiplyAdd => 3,
            Self::FloatDivide => 14,
        }
    }
}

//! The cycle model: the cost of an instruction on a Cortex-M4F that runs from the flash of an
//! STM32F405.
//!
//! Silicon has not been measured. Every number has its source:
//!
//! - TRM: ARM, *Cortex-M4 Technical Reference Manual* r0p1 (DDI 0439D), table 3-1 (instructions),
//!   section 3.9 (exceptions) and table 7-1 (floating point);
//! - RM0090: ST, *STM32F405/415 … reference manual*, section 3.5 (flash accelerator) and
//!   section 2 (buses).
//!
//! Where a table gives a range, the model takes its upper end. It never assumes pipelined loads or
//! stores, predicted branches or folded instructions. It does assume that data lies in SRAM, which
//! no other bus master uses at the same time, unless the address is a constant in flash or in a
//! peripheral.

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

/// Longest wait of a load of a constant from flash: the end of an instruction line's read, then its
/// own.
pub const FLASH_DATA_WAIT: u32 = 2 * FLASH_READ;

/// Longest wait of an access to a peripheral. The slower bus, APB1, runs at a quarter of the core's
/// clock; a transfer takes two of its cycles, after up to one for synchronisation (AMBA APB
/// protocol, IHI 0024, section 3.1).
pub const PERIPHERAL_WAIT: u32 = 12;

/// Cycles from the interrupt's request to its first instruction, TRM section 3.9.1: 12 without wait
/// states, plus the reads of the vector and of the first line from flash.
pub const EXCEPTION_ENTRY: u32 = 12 + 2 * FLASH_READ;

/// Cycles to save s0 … s15 and FPSCR when the handler first uses the floating-point unit: 17 stores
/// and one cycle to begin (TRM, section 7.2.2 and table 7-1, VSTM).
pub const LAZY_FLOAT_STACKING: u32 = 18;

/// Cycles to return to the interrupted program, TRM section 3.9.1: 12, plus 17 for the
/// floating-point state, plus the read of the next line.
pub const EXCEPTION_EXIT: u32 = 12 + 17 + FLASH_READ;

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
    /// Table branch: the load of the table and the refill.
    TableBranch,
    /// Branch; its refill is counted when it is taken.
    Branch,
    /// Floating-point addition, multiplication, comparison, conversion, move: 1, plus one if the
    /// next instruction uses the result.
    Float,
    /// Floating-point multiplication and addition: 3.
    FloatMultiplyAdd,
    /// Floating-point division or square root: 14.
    FloatDivide,
}

impl InstructionKind {
    /// Returns the cycles without wait states, excluding the refill of a branch.
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

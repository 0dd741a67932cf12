//! Cost of a basic block: its instructions, the reads of its flash lines, and its memory waits.

use crate::cycles::{ADDRESS_STALL, Chip, FLOAT_DIVIDE_REST, InstructionKind};
use crate::graph::Block;
use crate::instruction::{Instruction, Overlap};
use crate::values::{Value, Values, address, follow, wait};

/// Returns the cost of one pass through a block after its first line has been read, without called
/// functions.
pub fn of_block(block: &Block, chip: &Chip, values: &Values) -> u32 {
    let mut walk = Walk {
        charges_unknown: true,
        ..Walk::from(chip, values.clone())
    };
    for (place, instruction) in block.instructions.iter().enumerate() {
        walk.step(instruction, block.instructions.get(place + 1));
    }
    walk.cycles()
}

/// Returns the addresses of the instructions of a block that access a peripheral at a known address.
pub fn peripheral_accesses(block: &Block, chip: &Chip, values: &Values) -> Vec<u32> {
    let mut now = values.clone();
    let mut accesses = Vec::new();
    for instruction in &block.instructions {
        if instruction.words().is_some()
            && let Some(Value::Constant(address)) = address(instruction, &now, chip)
            && chip.is_peripheral(address)
        {
            accesses.push(instruction.address);
        }
        follow(&mut now, chip, instruction);
    }
    accesses
}

/// The cost of consecutive instructions.
///
/// A program in RAM waits for no line. In flash every line is waited for, as if nothing had been read ahead. With caches and
/// prefetch the wait is shorter or none; how these have been left does not matter.
#[derive(Clone, Debug)]
pub struct Walk<'a> {
    chip: &'a Chip,
    cycles: u32,
    values: Values,
    line: Option<u32>,
    /// Remaining cycles of a floating-point division.
    dividing: u32,
    /// The instruction executed before, except IT, if no branch was taken since.
    before: Option<&'a Instruction>,
    /// Whether a load from an unknown address is one from the program.
    charges_unknown: bool,
}

impl<'a> Walk<'a> {
    /// Starts a walk in a line that has been read.
    pub fn from(chip: &'a Chip, values: Values) -> Self {
        Self {
            chip,
            cycles: 0,
            values,
            line: None,
            dividing: 0,
            before: None,
            charges_unknown: false,
        }
    }

    /// Returns the cycles of all instructions so far.
    pub fn cycles(&self) -> u32 {
        self.cycles + self.dividing
    }

    /// Reads the lines of the flash that contain an instruction.
    fn read(&mut self, instruction: &Instruction) {
        let last_byte = instruction.address + instruction.size - 1;
        for touched in [instruction.address, last_byte].map(|at| at / self.chip.flash_line_bytes) {
            if self.chip.is_in_flash(instruction.address) && self.line != Some(touched) {
                let is_read = self.line.is_none();
                self.pass(u32::from(!is_read) * self.chip.flash_wait_states);
                self.line = Some(touched);
            }
        }
    }

    /// Passes an instruction whose condition does not hold.
    pub fn skip(&mut self, instruction: &Instruction) {
        self.read(instruction);
        self.pass(1);
        self.before = None;
    }

    /// Executes an instruction; `next` is the instruction executed after it, if known.
    pub fn step(&mut self, instruction: &'a Instruction, next: Option<&Instruction>) {
        self.read(instruction);
        if instruction.uses_float() {
            self.cycles += self.dividing;
            self.dividing = 0;
        }
        let is_known = address(instruction, &self.values, self.chip).is_some();
        let wait = if is_known || self.charges_unknown {
            wait(instruction, &self.values, self.chip)
        } else {
            0
        };
        let mut cycles = instruction.kind.cycles();
        cycles -= overlap(self.before, instruction, wait);
        cycles += stall(self.before, instruction);
        self.pass(cycles + wait);
        let is_used_next = next.is_none_or(|next| {
            let mut written = instruction.writes.iter();
            written.any(|register| next.reads.contains(register))
        });
        match instruction.kind {
            InstructionKind::Float | InstructionKind::FloatMultiplyAdd => {
                self.cycles += u32::from(is_used_next);
            }
            InstructionKind::FloatDivide => {
                self.dividing = FLOAT_DIVIDE_REST + u32::from(is_used_next);
            }
            _ => {}
        }
        follow(&mut self.values, self.chip, instruction);
        if !instruction.is_it() {
            self.before = Some(instruction);
        }
    }

    /// Takes a branch: the pipeline is refilled, in flash from a line that has to be read.
    pub fn branch(&mut self, target: u32) {
        self.pass(self.chip.branch(target));
        self.line = None;
        self.before = None;
    }

    /// Lets time pass, during which a division continues.
    fn pass(&mut self, cycles: u32) {
        self.cycles += cycles;
        self.dividing = self.dividing.saturating_sub(cycles);
    }
}

/// Returns the cycles by which an instruction with this wait for its memory overlaps with its neighbours. A
/// store to a register's value plus a constant overlaps with the instruction after it, every other load or store with a load
/// before it, unless this loads the address (TRM, section 3.3.2).
fn overlap(before: Option<&Instruction>, instruction: &Instruction, wait: u32) -> u32 {
    let follows_load = before.is_some_and(|before| {
        before.overlap == Some(Overlap::Load)
            && !before
                .writes
                .iter()
                .any(|it| instruction.address_from.contains(it))
    });
    match instruction.overlap {
        _ if wait > 0 => 0,
        Some(Overlap::Store) => 1,
        Some(Overlap::Load | Overlap::StoreIndexed) => u32::from(follows_load),
        None => 0,
    }
}

/// Returns the delay of an instruction whose address depends on the data-processing instruction before it.
fn stall(before: Option<&Instruction>, instruction: &Instruction) -> u32 {
    let depends = before.is_some_and(|before| {
        let is_memory = matches!(
            before.kind,
            InstructionKind::Load(_) | InstructionKind::Store(_)
        );
        !is_memory
            && before
                .writes
                .iter()
                .any(|it| instruction.address_from.contains(it))
    });
    u32::from(depends) * ADDRESS_STALL
}

/// Returns the cost of entering block `to` from block `from`. A taken branch refills the
/// pipeline. Without a branch, a line of the flash may begin at the block's start. The first address may depend on the last
/// instruction.
pub fn of_edge(chip: &Chip, from: &Block, to: &Block, taken: bool) -> u32 {
    let address = to.instructions[0].address;
    if taken {
        return chip.branch(address);
    }
    let starts_line = chip.is_in_flash(address) && address.is_multiple_of(chip.flash_line_bytes);
    let line = u32::from(starts_line) * chip.flash_wait_states;
    let last = from.instructions.iter().rfind(|it| !it.is_it());
    let first = to.instructions.iter().find(|it| !it.is_it());
    line + first.map_or(0, |first| stall(last, first))
}

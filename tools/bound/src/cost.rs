//! Cost of a basic block: its instructions, the reads of its flash lines, and its memory waits.

use std::collections::BTreeMap;

use crate::cycles::{
    ADDRESS_STALL, FLASH_DATA_WAIT, FLASH_LINE_BYTES, FLASH_READ, FLOAT_DIVIDE_REST,
    InstructionKind, PERIPHERAL_WAIT, PIPELINE_REFILL, data_wait, fetch_wait, is_in_flash,
};
use crate::graph::{Block, Graph};
use crate::instruction::{Effect, Instruction, KEPT_BY_CALLS, Overlap, PROGRAM_COUNTER};

/// Registers with known constant values.
pub type Constants = BTreeMap<u16, u32>;

/// Returns the constants at the start of every block, found by data flow from the entry.
pub fn constants(graph: &Graph) -> BTreeMap<u32, Constants> {
    let mut at: BTreeMap<u32, Constants> = BTreeMap::from([(graph.entry, Constants::new())]);
    let mut open = vec![graph.entry];
    while let Some(address) = open.pop() {
        let Some(block) = graph.blocks.get(&address) else {
            continue;
        };
        let mut now = at[&address].clone();
        for instruction in &block.instructions {
            follow(&mut now, instruction);
        }
        if block.call.is_some() {
            now.retain(|register, _| KEPT_BY_CALLS.contains(register));
        }
        for (to, _) in &block.successors {
            let changed = match at.get_mut(to) {
                None => {
                    at.insert(*to, now.clone());
                    true
                }
                Some(before) => {
                    let size = before.len();
                    before.retain(|register, value| now.get(register) == Some(value));
                    before.len() != size
                }
            };
            if changed {
                open.push(*to);
            }
        }
    }
    at
}

/// Returns the value of a register after a block's last instruction, if it is a known constant.
pub fn constant_after(block: &Block, before: &Constants, register: u16) -> Option<u32> {
    let mut now = before.clone();
    for instruction in &block.instructions {
        follow(&mut now, instruction);
    }
    now.get(&register).copied()
}

fn follow(now: &mut Constants, instruction: &Instruction) {
    let old = |register: &u16| now.get(register).copied();
    let value = match &instruction.effect {
        Some(Effect::Set(to, value)) => Some((*to, *value)),
        Some(Effect::SetUpper(to, value)) => {
            old(to).map(|lower| (*to, lower & 0xffff | value << 16))
        }
        Some(Effect::Add(to, from, value)) => {
            old(from).map(|base| (*to, base.wrapping_add_signed(*value)))
        }
        None => None,
    };
    for register in &instruction.writes {
        now.remove(register);
    }
    if let Some((register, value)) = value {
        now.insert(register, value);
    }
}

/// Cost of one pass through a block.
#[derive(Clone, Copy, Debug)]
pub struct BlockCost {
    /// Cycles, without called functions.
    pub cycles: u32,
    /// Cycles at the end of the block since the flash began to read the following line.
    pub reading: u32,
}

/// Returns the cost of one pass through a block after its first line has been read, without called
/// functions.
pub fn of_block(block: &Block, constants: &Constants) -> BlockCost {
    let mut walk = Walk::from(constants.clone());
    for (place, instruction) in block.instructions.iter().enumerate() {
        walk.step(instruction, block.instructions.get(place + 1));
    }
    BlockCost {
        cycles: walk.cycles(),
        reading: walk.reading,
    }
}

/// Returns the addresses of the instructions of a block that access a peripheral at an address known to the model.
pub fn peripheral_accesses(block: &Block, constants: &Constants) -> Vec<u32> {
    let mut now = constants.clone();
    let mut accesses = Vec::new();
    for instruction in &block.instructions {
        if wait(instruction, &now) == PERIPHERAL_WAIT {
            accesses.push(instruction.address);
        }
        follow(&mut now, instruction);
    }
    accesses
}

/// The cost of consecutive instructions.
///
/// A program in RAM waits for no line. In flash, while a line is executed, the accelerator reads the next one (RM0090, section 3.5.2, prefetch).
/// A line therefore takes as long as its instructions or as the read, whichever is longer. Both
/// grow with the cost of the instructions, so upper bounds of these give an upper bound. The same holds for a
/// floating-point division and the integer instructions executed during it.
#[derive(Clone, Debug, Default)]
pub struct Walk<'a> {
    cycles: u32,
    constants: Constants,
    line: Option<u32>,
    /// Cycles since the flash began to read the next line.
    reading: u32,
    /// Remaining cycles of a floating-point division.
    dividing: u32,
    /// The instruction executed before, except IT, if no branch was taken since.
    before: Option<&'a Instruction>,
}

impl<'a> Walk<'a> {
    /// Starts a walk in a line that has been read.
    pub fn from(constants: Constants) -> Self {
        Self {
            constants,
            ..Self::default()
        }
    }

    /// Returns the cycles of all instructions so far.
    pub fn cycles(&self) -> u32 {
        self.cycles + self.dividing
    }

    /// Executes an instruction; `next` is the instruction executed after it, if known.
    pub fn step(&mut self, instruction: &'a Instruction, next: Option<&Instruction>) {
        let last_byte = instruction.address + instruction.size - 1;
        for touched in [instruction.address, last_byte].map(|at| at / FLASH_LINE_BYTES) {
            match self.line {
                _ if !is_in_flash(instruction.address) => {}
                Some(line) if line >= touched => {}
                Some(_) => {
                    self.pass(FLASH_READ.saturating_sub(self.reading));
                    self.reading = 0;
                    self.line = Some(touched);
                }
                None => self.line = Some(touched),
            }
        }
        if instruction.uses_float() {
            self.cycles += self.dividing;
            self.reading += self.dividing;
            self.dividing = 0;
        }
        let wait = wait(instruction, &self.constants);
        let mut cycles = instruction.kind.cycles();
        cycles -= overlap(self.before, instruction, wait);
        cycles += stall(self.before, instruction);
        self.reading += cycles;
        self.pass(cycles);
        self.pass(wait);
        if wait == FLASH_DATA_WAIT {
            // The flash reads the data first, then begins with the next line.
            self.reading = 0;
        }
        let is_used_next = next.is_none_or(|next| {
            let mut written = instruction.writes.iter();
            written.any(|register| next.reads.contains(register))
        });
        match instruction.kind {
            InstructionKind::Float | InstructionKind::FloatMultiplyAdd => {
                self.cycles += u32::from(is_used_next);
                self.reading += u32::from(is_used_next);
            }
            InstructionKind::FloatDivide => {
                self.dividing = FLOAT_DIVIDE_REST + u32::from(is_used_next);
            }
            _ => {}
        }
        follow(&mut self.constants, instruction);
        if !instruction.is_it() {
            self.before = Some(instruction);
        }
    }

    /// Takes a branch: the pipeline is refilled, in flash from a line that has to be read.
    pub fn branch(&mut self, target: u32) {
        self.pass(branch(target));
        self.line = None;
        self.reading = 0;
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

/// Returns the additional wait of a load or store for its memory.
fn wait(instruction: &Instruction, now: &Constants) -> u32 {
    if instruction.kind == InstructionKind::TableBranch {
        return data_wait(instruction.address);
    }
    let Some((base, offset)) = instruction.memory else {
        return 0;
    };
    if base == PROGRAM_COUNTER {
        return data_wait(instruction.address);
    }
    let address = now.get(&base).map(|base| base.wrapping_add_signed(offset));
    address.map_or(0, data_wait)
}

/// Returns the cost of a taken branch beyond its own cycle.
pub fn branch(target: u32) -> u32 {
    PIPELINE_REFILL + fetch_wait(target)
}

/// Returns the cost of entering block `to` with this `cost` of block `from`. A taken branch refills the
/// pipeline. Without a branch, a line of the flash may end at the block's start; the next one is then being read
/// already. The first address may depend on the last instruction.
pub fn of_edge(from: &Block, cost: &BlockCost, to: &Block, taken: bool) -> u32 {
    let address = to.instructions[0].address;
    if taken {
        return branch(address);
    }
    let starts_line = is_in_flash(address) && address.is_multiple_of(FLASH_LINE_BYTES);
    let line = u32::from(starts_line) * FLASH_READ.saturating_sub(cost.reading);
    let last = from.instructions.iter().rfind(|it| !it.is_it());
    let first = to.instructions.iter().find(|it| !it.is_it());
    line + first.map_or(0, |first| stall(last, first))
}

//! Cost of a basic block: its instructions, the reads of its flash lines, and its memory waits.

use std::collections::BTreeMap;

use crate::cycles::{
    FLASH_DATA_WAIT, FLASH_LINE_BYTES, FLASH_READ, InstructionKind, PIPELINE_REFILL, data_wait,
    fetch_wait, is_in_flash,
};
use crate::graph::{Block, Graph};
use crate::instruction::{Effect, Instruction, PROGRAM_COUNTER};

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
            // The callee may change the registers that the calling convention allows; here all are
            // assumed changed.
            now.clear();
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
        cycles: walk.cycles,
        reading: walk.reading,
    }
}

/// The cost of consecutive instructions.
///
/// A program in RAM waits for no line. In flash, while a line is executed, the accelerator reads the next one (RM0090, section 3.5.2, prefetch).
/// A line therefore takes as long as its instructions or as the read, whichever is longer. Both
/// grow with the cost of the instructions, so upper bounds of these give an upper bound.
#[derive(Clone, Debug, Default)]
pub struct Walk {
    /// Cycles.
    pub cycles: u32,
    constants: Constants,
    line: Option<u32>,
    /// Cycles since the flash began to read the next line.
    reading: u32,
}

impl Walk {
    /// Starts a walk in a line that has been read.
    pub fn from(constants: Constants) -> Self {
        Self {
            constants,
            ..Self::default()
        }
    }

    /// Executes an instruction; `next` is the instruction executed after it, if known.
    pub fn step(&mut self, instruction: &Instruction, next: Option<&Instruction>) {
        let last_byte = instruction.address + instruction.size - 1;
        for touched in [instruction.address, last_byte].map(|at| at / FLASH_LINE_BYTES) {
            match self.line {
                _ if !is_in_flash(instruction.address) => {}
                Some(line) if line >= touched => {}
                Some(_) => {
                    self.cycles += FLASH_READ.saturating_sub(self.reading);
                    self.reading = 0;
                    self.line = Some(touched);
                }
                None => self.line = Some(touched),
            }
        }
        let mut cycles = instruction.kind.cycles();
        if matches!(
            instruction.kind,
            InstructionKind::Float | InstructionKind::FloatMultiplyAdd
        ) {
            let uses = |next: &Instruction| {
                let mut written = instruction.writes.iter();
                written.any(|register| next.reads.contains(register))
            };
            cycles += u32::from(next.is_none_or(uses));
        }
        self.reading += cycles;
        self.cycles += cycles;
        match wait(instruction, &self.constants) {
            Some(FLASH_DATA_WAIT) => {
                self.cycles += FLASH_DATA_WAIT;
                // The flash reads the data first, then begins with the next line.
                self.reading = 0;
            }
            Some(cycles) => self.cycles += cycles,
            None => {}
        }
        follow(&mut self.constants, instruction);
    }

    /// Takes a branch: the pipeline is refilled, in flash from a line that has to be read.
    pub fn branch(&mut self, target: u32) {
        self.cycles += branch(target);
        self.line = None;
        self.reading = 0;
    }
}

/// Returns the additional wait of a load or store for its memory.
fn wait(instruction: &Instruction, now: &Constants) -> Option<u32> {
    if instruction.kind == InstructionKind::TableBranch {
        return Some(data_wait(instruction.address));
    }
    let (base, offset) = instruction.memory?;
    if base == PROGRAM_COUNTER {
        return Some(data_wait(instruction.address));
    }
    Some(data_wait(now.get(&base)?.wrapping_add_signed(offset)))
}

/// Returns the cost of a taken branch beyond its own cycle.
pub fn branch(target: u32) -> u32 {
    PIPELINE_REFILL + fetch_wait(target)
}

/// Returns the cost of entering a block. A taken branch refills the pipeline. Without a branch, a line
/// of the flash may end at the block's start; the next one is then being read already.
pub fn of_edge(from: &BlockCost, to: &Block, taken: bool) -> u32 {
    let address = to.instructions[0].address;
    if taken {
        return branch(address);
    }
    let starts_line = is_in_flash(address) && address.is_multiple_of(FLASH_LINE_BYTES);
    u32::from(starts_line) * FLASH_READ.saturating_sub(from.reading)
}

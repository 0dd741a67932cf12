//! Control-flow graph of one function.

use std::collections::{BTreeMap, BTreeSet};

use crate::BoundError;
use crate::image::Image;
use crate::instruction::{Decoder, Flow, Instruction};

/// Instructions that are executed in sequence.
#[derive(Clone, Debug)]
pub struct Block {
    /// The instructions; at least one.
    pub instructions: Vec<Instruction>,
    /// The following blocks, and whether they are reached by a taken branch.
    pub successors: Vec<(u32, bool)>,
    /// Whether the function may return here.
    pub returns: bool,
    /// The function that the last instruction calls.
    pub call: Option<u32>,
    /// Whether that call depends on a condition.
    pub may_skip_call: bool,
}

/// A function's blocks by address.
#[derive(Clone, Debug)]
pub struct Graph {
    /// Address of the first instruction.
    pub entry: u32,
    /// The blocks.
    pub blocks: BTreeMap<u32, Block>,
}

impl Graph {
    /// Builds the graph of the function at `entry`. A branch into another function, which then
    /// returns to this function's caller, is followed.
    ///
    /// # Errors
    /// [`BoundError`] for an instruction that cannot be decoded.
    pub fn of(image: &Image, decoder: &Decoder, entry: u32) -> Result<Self, BoundError> {
        let mut instructions: BTreeMap<u32, Instruction> = BTreeMap::new();
        let mut leaders = BTreeSet::from([entry]);
        let mut tables: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        let mut open = vec![(entry, 0_u32)];
        while let Some((mut at, mut conditional)) = open.pop() {
            while !instructions.contains_key(&at) {
                let instruction = decoder.at(image, at, conditional > 0)?;
                conditional = conditional.saturating_sub(1);
                if instruction.text.starts_with("it") {
                    let name = instruction.text.split(' ').next().unwrap_or_default();
                    conditional = name.len() as u32 - 1;
                }
                let next = at + instruction.size;
                let flow = instruction.flow.clone();
                instructions.insert(at, instruction);
                match flow {
                    Flow::Next => {}
                    Flow::Branch {
                        target,
                        conditional: goes_on,
                    } => {
                        leaders.insert(target);
                        open.push((target, 0));
                        if !goes_on {
                            break;
                        }
                        leaders.insert(next);
                    }
                    Flow::Call { .. } => {
                        leaders.insert(next);
                    }
                    Flow::Return { conditional: false } | Flow::Trap => break,
                    Flow::Return { conditional: true } => {
                        leaders.insert(next);
                    }
                    Flow::Table => {
                        let targets = table(image, &instructions, at)?;
                        leaders.extend(&targets);
                        open.extend(targets.iter().map(|target| (*target, 0)));
                        tables.insert(at, targets);
                        break;
                    }
                }
                at = next;
            }
        }
        Ok(Self {
            entry,
            blocks: blocks(&instructions, &leaders, &tables),
        })
    }

    /// Returns whether an instruction uses the floating-point unit.
    pub fn uses_float(&self) -> bool {
        let mut instructions = self.blocks.values().flat_map(|block| &block.instructions);
        instructions.any(Instruction::uses_float)
    }
}

/// Returns the targets of the table branch at an address, whose predecessors are in `instructions`.
fn table(
    image: &Image,
    instructions: &BTreeMap<u32, Instruction>,
    at: u32,
) -> Result<Vec<u32>, BoundError> {
    let branch = &instructions[&at];
    let unknown = || BoundError::UnknownInstruction {
        address: branch.address,
        text: branch.text.clone(),
    };
    let start = start_of_table(instructions, branch).ok_or_else(unknown)?;
    let width = if branch.text.starts_with("tbh") { 2 } else { 1 };
    let end = image.end_of_data(start).ok_or_else(unknown)?;
    let bytes = image.bytes(start).ok_or_else(unknown)?;
    let bytes = bytes.get(..(end - start) as usize).ok_or_else(unknown)?;
    let mut targets = Vec::new();
    for entry in bytes.chunks_exact(width) {
        let half_words = entry
            .iter()
            .rev()
            .fold(0_u32, |sum, byte| sum << 8 | u32::from(*byte));
        // From the program counter, wherever the table is (ARMv7-M, TBB).
        let target = branch.address + branch.size + 2 * half_words;
        // Padding and literals may follow the table. No entry leads into them, or into another function.
        if target < end || image.name(target) != image.name(at) {
            break;
        }
        targets.push(target);
    }
    if targets.is_empty() {
        return Err(unknown());
    }
    targets.sort_unstable();
    targets.dedup();
    Ok(targets)
}

/// Returns the address of a branch's table: behind the branch, or, if a literal lies between them, the address
/// that an `adr` (or `addw` with the program counter) before the branch has put into its base register.
fn start_of_table(instructions: &BTreeMap<u32, Instruction>, branch: &Instruction) -> Option<u32> {
    /// The compiler may schedule a polynomial between the two.
    const FARTHEST: usize = 64;
    let base = branch.text.split(['[', ',']).nth(1)?;
    if base == "pc" {
        return Some(branch.address + branch.size);
    }
    let mut before = instructions.range(..branch.address).rev().take(FARTHEST);
    // The last instruction that names the base first; if it is another one, the table is unknown.
    let (from, mnemonic, offset) = before.find_map(|(from, instruction)| {
        let (mnemonic, operands) = instruction.text.split_once(' ')?;
        let (register, offset) = operands.split_once(", ")?;
        (register == base).then_some((from, mnemonic, offset))
    })?;
    let offset = match mnemonic {
        "adr" | "adr.w" => offset.strip_prefix('#')?,
        _ => offset.strip_prefix("pc, #")?,
    };
    let offset = match offset.strip_prefix("0x") {
        Some(digits) => u32::from_str_radix(digits, 16),
        None => offset.parse(),
    };
    Some(((from + 4) & !3) + offset.ok()?)
}

fn blocks(
    instructions: &BTreeMap<u32, Instruction>,
    leaders: &BTreeSet<u32>,
    tables: &BTreeMap<u32, Vec<u32>>,
) -> BTreeMap<u32, Block> {
    let mut blocks = BTreeMap::new();
    for leader in leaders {
        let mut block = Block {
            instructions: Vec::new(),
            successors: Vec::new(),
            returns: false,
            call: None,
            may_skip_call: false,
        };
        let mut at = *leader;
        while let Some(instruction) = instructions.get(&at) {
            block.instructions.push(instruction.clone());
            let next = at + instruction.size;
            match &instruction.flow {
                Flow::Next if leaders.contains(&next) => block.successors.push((next, false)),
                Flow::Next => {
                    at = next;
                    continue;
                }
                Flow::Branch {
                    target,
                    conditional,
                } => {
                    block.successors.push((*target, true));
                    if *conditional {
                        block.successors.push((next, false));
                    }
                }
                Flow::Call {
                    target,
                    conditional,
                } => {
                    block.call = Some(*target);
                    block.may_skip_call = *conditional;
                    block.successors.push((next, true));
                }
                Flow::Return { conditional } => {
                    block.returns = true;
                    if *conditional {
                        block.successors.push((next, false));
                    }
                }
                Flow::Table => {
                    let targets = tables.get(&at).into_iter().flatten();
                    block.successors.extend(targets.map(|to| (*to, true)));
                }
                Flow::Trap => {}
            }
            break;
        }
        if !block.instructions.is_empty() {
            blocks.insert(*leader, block);
        }
    }
    blocks
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::instruction::Decoder;

    /// A table of four targets, its padding and a literal, as the compiler lays them out.
    #[test]
    fn a_table_ends_where_padding_and_literals_begin() {
        let mut code = vec![0xdf, 0xe8, 0x05, 0xf0]; // tbb [pc, r5]
        code.extend([6, 7, 8, 9]);
        code.extend([0x00, 0xbf]); // nop
        code.extend([0x52, 0xb8, 0x7e, 0x3f, 0x03, 0x00]);
        code.extend([0x70, 0x47].repeat(8)); // bx lr
        let mut image = Image::of_code(0x100, &code, "switch");
        image.mark(0x100, true);
        image.mark(0x104, false);
        image.mark(0x110, true);
        let branch = Decoder::new().unwrap().at(&image, 0x100, false).unwrap();
        let targets = table(&image, &BTreeMap::from([(0x100, branch)]), 0x100).unwrap();
        assert_eq!(targets, [0x110, 0x112, 0x114, 0x116]);
    }

    /// A literal behind the table that would be an entry leads into another function.
    #[test]
    fn a_table_leads_into_its_own_function_only() {
        let mut code = vec![0xdf, 0xe8, 0x15, 0xf0]; // tbh [pc, r5, lsl #1]
        code.extend([4, 0, 5, 0]);
        code.extend([0x40, 0x00, 0x40, 0x00]);
        code.extend([0x70, 0x47].repeat(2)); // bx lr
        let mut image = Image::of_code(0x100, &code, "switch");
        image.begin_function(0x110, "next");
        image.mark(0x100, true);
        image.mark(0x104, false);
        image.mark(0x10c, true);
        let branch = Decoder::new().unwrap().at(&image, 0x100, false).unwrap();
        let targets = table(&image, &BTreeMap::from([(0x100, branch)]), 0x100).unwrap();
        assert_eq!(targets, [0x10c, 0x10e]);
    }

    /// The base of the table is a register, because a literal lies between branch and table.
    #[test]
    fn a_table_behind_a_literal_is_found_by_its_adr() {
        let mut code = vec![0x02, 0xa0]; // adr r0, #8
        code.extend([0x00, 0xbf]); // nop
        code.extend([0xd0, 0xe8, 0x01, 0xf0]); // tbb [r0, r1]
        code.extend([0x00; 4]); // 0.0
        code.extend([4, 5]); // half-words behind the branch, not behind the table
        code.extend([0x00, 0xbf]);
        code.extend([0x70, 0x47].repeat(4)); // bx lr
        let mut image = Image::of_code(0x100, &code, "switch");
        image.mark(0x100, true);
        image.mark(0x108, false);
        image.mark(0x110, true);
        let graph = Graph::of(&image, &Decoder::new().unwrap(), 0x100).unwrap();
        let leaders: Vec<u32> = graph.blocks.keys().copied().collect();
        assert_eq!(leaders, [0x100, 0x110, 0x112]);
    }
}

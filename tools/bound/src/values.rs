//! What is known about registers: constants, and addresses of variables.
//!
//! Found by data flow from the handlers through their functions and those that they call. An address that is computed from one of a
//! variable or of the stack stays within the memory of these, as no pointer leaves its object. What is loaded is not known.

use std::collections::{BTreeMap, BTreeSet};

use crate::BoundError;
use crate::cycles::Chip;
use crate::effect::Effect;
use crate::graph::{Block, Graph};
use crate::image::Image;
use crate::instruction::{
    ARGUMENTS, Decoder, Instruction, KEPT_BY_CALLS, PROGRAM_COUNTER, STACK_POINTER,
};

/// What is known about a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Value {
    /// A constant.
    Constant(u32),
    /// An address of a variable or of the stack.
    Data,
}

/// Registers about which something is known.
pub type Values = BTreeMap<u16, Value>;

/// Returns what two values have in common.
fn common(chip: &Chip, one: Value, other: Value) -> Option<Value> {
    if one == other {
        return Some(one);
    }
    (is_data(chip, one) && is_data(chip, other)).then_some(Value::Data)
}

fn is_data(chip: &Chip, value: Value) -> bool {
    match value {
        Value::Constant(address) => chip.is_data(address),
        Value::Data => true,
    }
}

/// Returns what is known about a register.
fn of(now: &Values, register: u16) -> Option<Value> {
    if register == STACK_POINTER {
        Some(Value::Data)
    } else {
        now.get(&register).copied()
    }
}

/// Follows the effect of an instruction on the registers.
pub fn follow(now: &mut Values, chip: &Chip, instruction: &Instruction) {
    let data = |value: Option<Value>| value.filter(|it| is_data(chip, *it)).map(|_| Value::Data);
    let effect = match instruction.effect {
        Some(Effect::Set(to, value)) => Some((to, Some(Value::Constant(value)))),
        Some(Effect::SetUpper(to, value)) => Some((
            to,
            match of(now, to) {
                Some(Value::Constant(lower)) => Some(Value::Constant(lower & 0xffff | value << 16)),
                _ => None,
            },
        )),
        Some(Effect::Add(to, from, value)) => Some((
            to,
            match of(now, from) {
                Some(Value::Constant(base)) => {
                    Some(Value::Constant(base.wrapping_add_signed(value)))
                }
                other => other,
            },
        )),
        Some(Effect::AddRegister(to, one, other)) => {
            Some((to, data(of(now, one)).or(data(of(now, other)))))
        }
        Some(Effect::Advance(base)) => Some((base, data(of(now, base)))),
        None => None,
    };
    for register in &instruction.writes {
        now.remove(register);
    }
    if let Some((register, Some(value))) = effect {
        now.insert(register, value);
    }
}

/// Returns the longest wait of a load or store for its memory. A load is one from the program, unless its address is known.
pub fn wait(instruction: &Instruction, now: &Values, chip: &Chip) -> u32 {
    instruction.words().map_or(0, |words| {
        words
            * match address(instruction, now, chip) {
                Some(Value::Constant(address)) => chip.data_wait(address),
                Some(Value::Data) => 0,
                None if instruction.loads() => chip.program_wait(),
                None => 0,
            }
    })
}

/// Returns the address of an instruction's memory access, without an index. A constant that is no address of a memory may
/// be the index.
pub fn address(instruction: &Instruction, now: &Values, chip: &Chip) -> Option<Value> {
    let base = *instruction.address_from.first()?;
    if base == PROGRAM_COUNTER {
        return Some(Value::Constant(instruction.address));
    }
    let offset = instruction.memory.map_or(0, |(_, offset)| offset);
    let is_indexed = instruction.address_from.len() > 1;
    match of(now, base)? {
        Value::Constant(base) if is_indexed && !chip.is_memory(base) => None,
        Value::Constant(base) => Some(Value::Constant(base.wrapping_add_signed(offset))),
        Value::Data => Some(Value::Data),
    }
}

/// Returns the values at the start of every block, found by data flow from those at the entry.
pub fn within(graph: &Graph, chip: &Chip, entry: &Values) -> BTreeMap<u32, Values> {
    let mut at = BTreeMap::from([(graph.entry, entry.clone())]);
    let mut open = vec![graph.entry];
    while let Some(address) = open.pop() {
        let Some(block) = graph.blocks.get(&address) else {
            continue;
        };
        let mut now = after(block, chip, &at[&address]);
        if block.call.is_some() {
            now.retain(|register, _| KEPT_BY_CALLS.contains(register));
        }
        for (to, _) in &block.successors {
            if join(&mut at, chip, *to, &now) {
                open.push(*to);
            }
        }
    }
    at
}

/// Returns the values after a block's last instruction, before its call.
pub fn after(block: &Block, chip: &Chip, before: &Values) -> Values {
    let mut now = before.clone();
    for instruction in &block.instructions {
        follow(&mut now, chip, instruction);
    }
    now
}

/// Keeps what is known at an address by all ways to it; returns whether that has changed.
fn join(at: &mut BTreeMap<u32, Values>, chip: &Chip, to: u32, now: &Values) -> bool {
    let Some(before) = at.get_mut(&to) else {
        at.insert(to, now.clone());
        return true;
    };
    let mut changed = false;
    before.retain(|register, value| {
        let kept = now.get(register).and_then(|it| common(chip, *value, *it));
        changed |= kept != Some(*value);
        kept.is_some_and(|kept| {
            *value = kept;
            true
        })
    });
    changed
}

/// The functions that handlers call.
pub struct Program<'a> {
    /// The image.
    pub image: &'a Image,
    functions: BTreeMap<u32, Function>,
}

/// A function, and what is known in it however it is called.
struct Function {
    graph: Graph,
    values: BTreeMap<u32, Values>,
}

impl<'a> Program<'a> {
    /// Follows the functions at these addresses, with what is known when they begin, and what they call except for some functions.
    ///
    /// # Errors
    /// [`BoundError`] for an instruction that cannot be decoded.
    pub fn of(
        image: &'a Image,
        mut entries: BTreeMap<u32, Values>,
        except: &BTreeSet<u32>,
    ) -> Result<Self, BoundError> {
        let decoder = Decoder::new()?;
        let mut functions = BTreeMap::new();
        let mut open: Vec<u32> = entries.keys().copied().collect();
        while let Some(entry) = open.pop() {
            let graph = match functions.remove(&entry) {
                Some(Function { graph, .. }) => graph,
                None => Graph::of(image, &decoder, entry)?,
            };
            let values = within(&graph, image.chip, &entries[&entry]);
            for (address, block) in &graph.blocks {
                let (Some(callee), Some(before)) = (block.call, values.get(address)) else {
                    continue;
                };
                let mut arguments = after(block, image.chip, before);
                arguments.retain(|register, _| ARGUMENTS.contains(register));
                if !except.contains(&callee) && join(&mut entries, image.chip, callee, &arguments) {
                    open.push(callee);
                }
            }
            functions.insert(entry, Function { graph, values });
        }
        Ok(Self { image, functions })
    }

    /// Returns the graph of a function, and the values at the start of its blocks; `None` if no handler calls it.
    pub fn function(&self, entry: u32) -> Option<(&Graph, &BTreeMap<u32, Values>)> {
        let function = self.functions.get(&entry)?;
        Some((&function.graph, &function.values))
    }
}

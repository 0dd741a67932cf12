//! Where the instructions of an executed interrupt are spent: by kind and by source file.

use std::collections::BTreeMap;
use std::fmt::{Display, Formatter};

use crate::BoundError;
use crate::cycles::InstructionKind;
use crate::image::Image;
use crate::instruction::{Decoder, Flow, Instruction};

/// Kind of an instruction by its purpose.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, strum::Display)]
#[strum(serialize_all = "lowercase")]
pub enum Purpose {
    /// Float arithmetic, including divisions and roots.
    #[strum(to_string = "float arithmetic")]
    Float,
    /// Float comparisons, including the transfer of the flags.
    #[strum(to_string = "float comparison")]
    FloatCompare,
    /// Between float and integer: conversions and transfers of registers.
    #[strum(to_string = "float to or from integer")]
    Convert,
    /// Moves between float registers, and float constants.
    #[strum(to_string = "float move")]
    FloatMove,
    /// Load or store of one register.
    #[strum(to_string = "load or store")]
    Memory,
    /// Loads, stores, pushes and pops relative to the stack pointer.
    #[strum(to_string = "stack")]
    Stack,
    /// Load or store of several registers: mostly copies.
    #[strum(to_string = "load or store of several registers")]
    Several,
    /// Integer comparisons and conditions.
    #[strum(to_string = "integer comparison")]
    Compare,
    /// Branches, calls and returns.
    Branch,
    /// Integer arithmetic and moves.
    Integer,
}

impl Purpose {
    fn of(instruction: &Instruction) -> Self {
        let name = instruction
            .text
            .split(['.', ' '])
            .next()
            .unwrap_or_default();
        let on_stack =
            instruction.text.contains("[sp") || name.ends_with("push") || name.ends_with("pop");
        match instruction.kind {
            _ if instruction.flow != Flow::Next => Self::Branch,
            InstructionKind::Load(_) | InstructionKind::Store(_) if on_stack => Self::Stack,
            InstructionKind::Load(1) | InstructionKind::Store(1) => Self::Memory,
            InstructionKind::Load(_) | InstructionKind::Store(_) => Self::Several,
            _ if name.starts_with("vcmp") || name == "vmrs" => Self::FloatCompare,
            _ if name.starts_with("vcvt") => Self::Convert,
            _ if name.starts_with("vmov") => {
                let has_core_register = instruction.text.split([' ', ',']).any(|it| {
                    it.starts_with('r') || matches!(it, "lr" | "ip" | "sb" | "sl" | "fp")
                });
                if has_core_register {
                    Self::Convert
                } else {
                    Self::FloatMove
                }
            }
            _ if instruction.uses_float() => Self::Float,
            _ if instruction.is_it() || ["cmp", "cmn", "tst", "teq"].contains(&name) => {
                Self::Compare
            }
            _ => Self::Integer,
        }
    }
}

/// Instructions of an executed interrupt.
#[derive(Clone, Debug, Default)]
pub struct Profile {
    /// Instructions by purpose.
    pub purposes: BTreeMap<Purpose, u32>,
    /// Instructions by source file: that of the innermost function, without the mechanics and numbers that all share.
    pub parts: BTreeMap<String, u32>,
}

impl Profile {
    /// Sorts the instructions of an interrupt, given by their addresses.
    ///
    /// # Errors
    /// [`BoundError`] for an instruction that cannot be decoded.
    pub fn of(image: &Image, addresses: &[u32]) -> Result<Self, BoundError> {
        let decoder = Decoder::new()?;
        let mut times = BTreeMap::new();
        for address in addresses {
            *times.entry(*address).or_insert(0) += 1;
        }
        let mut profile = Self::default();
        for (address, times) in times {
            let instruction = decoder.at(image, address, false)?;
            *profile
                .purposes
                .entry(Purpose::of(&instruction))
                .or_default() += times;
            let frames = image.frames(address);
            let ours = frames.iter().find(|it| is_part(&it.file));
            let part = ours.map_or("others", |it| &it.file);
            *profile.parts.entry(part.to_owned()).or_default() += times;
        }
        Ok(profile)
    }
}

/// Returns whether a file is a part of the tick of its own.
fn is_part(file: &str) -> bool {
    file.starts_with("firmware/")
}

impl Display for Profile {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> std::fmt::Result {
        let mut list = |items: Vec<(String, u32)>| {
            let mut items = items;
            items.sort_by_key(|(_, times)| core::cmp::Reverse(*times));
            items
                .iter()
                .try_for_each(|(name, times)| writeln!(formatter, "{times:>7}  {name}"))
        };
        list(
            self.purposes
                .iter()
                .map(|(it, times)| (it.to_string(), *times))
                .collect(),
        )?;
        list(
            self.parts
                .iter()
                .map(|(it, times)| (it.clone(), *times))
                .collect(),
        )
    }
}

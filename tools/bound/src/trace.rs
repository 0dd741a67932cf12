//! The cycle model applied to executed ticks: none may exceed the bound, and no loop may exceed its
//! declared limit.

use std::collections::BTreeMap;

use crate::BoundError;
use crate::cost::Walk;
use crate::image::Image;
use crate::instruction::{Decoder, Flow, Instruction};
use crate::loops::Limit;
use crate::values::Values;
use crate::worst::Loop;

/// Cost of an executed interrupt.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Executed {
    /// Cycles under the model, including entry and exit, without waits for loads from addresses that the instructions do not show.
    pub cycles: u32,
    /// Instructions.
    pub instructions: u32,
}

/// Computes the cost of executed instructions of one image.
pub struct Tracer<'a> {
    image: &'a Image,
    decoder: Decoder,
    decoded: BTreeMap<u32, Instruction>,
}

impl<'a> Tracer<'a> {
    /// Creates a tracer for an image.
    ///
    /// # Errors
    /// [`BoundError::Decoder`].
    pub fn new(image: &'a Image) -> Result<Self, BoundError> {
        Ok(Self {
            image,
            decoder: Decoder::new()?,
            decoded: BTreeMap::new(),
        })
    }

    /// Returns the cost of an interrupt from the addresses of its instructions in order.
    ///
    /// # Errors
    /// [`BoundError`] for an instruction of unknown cost.
    pub fn cost(&mut self, addresses: &[u32]) -> Result<Executed, BoundError> {
        let path = self.path(addresses)?;
        let mut walk = Walk::from(self.image.chip, Values::new());
        for (place, (address, is_executed)) in path.iter().enumerate() {
            let instruction = &self.decoded[address];
            let next = path.get(place + 1).map(|(next, _)| &self.decoded[next]);
            if *is_executed {
                walk.step(instruction, next);
            } else {
                walk.skip(instruction);
            }
            if let Some(next) = next
                && next.address != address + instruction.size
            {
                walk.branch(next.address);
            }
        }
        let handler = addresses.first().copied().unwrap_or_default();
        let uses_float = addresses.iter().any(|it| self.decoded[it].uses_float());
        Ok(Executed {
            cycles: walk.cycles() + self.image.chip.around(handler, uses_float),
            instructions: addresses.len() as u32,
        })
    }

    /// Decodes executed instructions, and the conditional ones that have been passed between them. Returns the addresses of
    /// all, and which have been executed.
    fn path(&mut self, addresses: &[u32]) -> Result<Vec<(u32, bool)>, BoundError> {
        let mut path = Vec::with_capacity(addresses.len());
        for (place, address) in addresses.iter().enumerate() {
            let (size, goes_on) = self.decode(*address)?;
            path.push((*address, true));
            let mut after = address + size;
            let next = addresses.get(place + 1).copied().unwrap_or(after);
            while goes_on && after < next {
                path.push((after, false));
                after += self.decode(after)?.0;
            }
        }
        Ok(path)
    }

    /// Decodes an instruction; returns its size, and whether the next one is always that behind it.
    fn decode(&mut self, address: u32) -> Result<(u32, bool), BoundError> {
        if !self.decoded.contains_key(&address) {
            let instruction = self.decoder.at(self.image, address, false)?;
            instruction.check()?;
            self.decoded.insert(address, instruction);
        }
        let instruction = &self.decoded[&address];
        Ok((instruction.size, instruction.flow == Flow::Next))
    }
}

/// Executed instructions with the last round alone of each wait for hardware.
#[derive(Clone, Debug)]
pub struct WithoutWaits {
    /// Addresses of the instructions.
    pub addresses: Vec<u32>,
    /// Cycles to which the bound limits the waits.
    pub waited_cycles: u32,
}

/// Leaves out all but the last round of each wait for hardware. The emulated clock is not that of the model: a wait has other
/// rounds, but the same time.
pub fn without_waits(loops: &[Loop], addresses: &[u32]) -> WithoutWaits {
    let (mut kept, mut waited, mut start) = (Vec::new(), 0, 0);
    for address in addresses {
        let mut begun = loops.iter().filter(|one| one.header == *address);
        let wait = begun.find_map(|one| match one.limit {
            Limit::Cycles(cycles) => Some((one, cycles)),
            Limit::Times(_) => None,
        });
        if let Some((one, cycles)) = wait {
            if kept.last().is_some_and(|before| one.contains(*before)) {
                kept.truncate(start);
            } else {
                start = kept.len();
                waited += cycles;
            }
        }
        kept.push(*address);
    }
    WithoutWaits {
        addresses: kept,
        waited_cycles: waited,
    }
}

/// Returns the largest number of iterations of a loop among all its entries in the executed
/// instructions.
pub fn rounds(one: &Loop, addresses: &[u32]) -> u32 {
    let (mut most, mut now, mut before) = (0, 0, None);
    for address in addresses {
        if *address == one.header {
            let again = before.is_some_and(|before| one.contains(before));
            now = if again { now + 1 } else { 1 };
            most = most.max(now);
        }
        before = Some(*address);
    }
    most
}

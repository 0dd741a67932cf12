//! The cycle model applied to executed ticks: none may exceed the bound, and no loop may exceed its
//! declared limit.

use std::collections::BTreeMap;

use crate::BoundError;
use crate::cost::Walk;
use crate::image::Image;
use crate::instruction::{Decoder, Instruction};
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
        for address in addresses {
            if !self.decoded.contains_key(address) {
                let instruction = self.decoder.at(self.image, *address, false)?;
                instruction.check()?;
                self.decoded.insert(*address, instruction);
            }
        }
        let mut walk = Walk::from(self.image.chip, Values::new());
        for (place, address) in addresses.iter().enumerate() {
            let instruction = &self.decoded[address];
            let next = addresses.get(place + 1).map(|next| &self.decoded[next]);
            walk.step(instruction, next);
            if let Some(next) = next
                && next.address != address + instruction.size
            {
                walk.branch(next.address);
            }
        }
        let handler = addresses.first().copied().unwrap_or_default();
        Ok(Executed {
            cycles: walk.cycles() + self.image.chip.around(handler, true),
            instructions: addresses.len() as u32,
        })
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

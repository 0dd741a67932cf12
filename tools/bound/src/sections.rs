//! Sections of the tasks of lower priority that mask the control interrupt, and may therefore delay it.
//!
//! RTIC's lock of the shared state raises BASEPRI to its ceiling; a critical section sets PRIMASK. A section is bounded from
//! the instruction that masks to the first that ends it. The log has none: it drops what two tasks write at once.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::{Display, Formatter};

use serde::Serialize;

use crate::BoundError;
use crate::graph::{Block, Graph};
use crate::image::Image;
use crate::instruction::{Decoder, Instruction};
use crate::loops::{Limits, panics};
use crate::values::{Program, Values, within};
use crate::worst::Analysis;

/// Functions whose sections are left out, with the reason.
pub const LEFT_OUT: [(&str, &str); 5] = [
    ("link::stop", "the torque is taken off"),
    (
        "link::configure",
        "the torque is off until the drive is armed",
    ),
    ("tasks::panicked", "the torque is taken off"),
    ("main", "the start: no task runs"),
    ("main::__rtic_init_resources", "the start: no task runs"),
];

/// A section that masks the control interrupt.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct Section {
    /// Most cycles.
    pub cycles: u32,
    /// The function of the tasks that contains it.
    pub function: String,
    /// Its file.
    pub file: String,
    /// Its line.
    pub line: u32,
}

impl Display for Section {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> std::fmt::Result {
        let (cycles, function) = (self.cycles, &self.function);
        write!(
            formatter,
            "{cycles:>7}  {function}  {}:{}",
            self.file, self.line
        )
    }
}

/// Returns the sections of an image, except those of some functions and of [`LEFT_OUT`], the longest last.
///
/// # Errors
/// [`BoundError`] for code that cannot be bounded.
pub fn of(image: &Image, except: &[u32]) -> Result<Vec<Section>, BoundError> {
    let decoder = Decoder::new()?;
    let panics = panics(image);
    let limits = Limits::of_tick(image.chip);
    let mut sections = BTreeSet::new();
    for (start, end, name) in image.functions() {
        let is = |(left_out, _): &(&str, &str)| {
            name == *left_out || left_out.contains("::") && name.contains(left_out)
        };
        if except.contains(&start) || LEFT_OUT.iter().any(is) {
            continue;
        }
        // Data between instructions may look like one, which the graph then does not contain.
        let decoded = |at| decoder.at(image, at, false);
        if !(start..end)
            .step_by(2)
            .any(|at| decoded(at).is_ok_and(|it| masks(&it)))
        {
            continue;
        }
        let graph = Graph::of(image, &decoder, start)?;
        for block in graph.blocks.values() {
            for (place, first) in block.instructions.iter().enumerate() {
                if !masks(first) {
                    continue;
                }
                let part = part(&graph, block, place, &panics)?;
                let callees = part.blocks.values().filter_map(|it| it.call);
                let callees = callees.filter(|it| !panics.contains(it));
                let callees = callees.map(|it| (it, Values::new())).collect();
                let program = Program::of(image, callees, &panics)?;
                let values = within(&part, image.chip, &Values::new());
                let mut analysis = Analysis::new(&program, &limits).without(&panics);
                let worst = analysis.of_graph(&part, &values)?;
                let address = first.address;
                let cycles = worst.ok_or(BoundError::NeverReturns { address })?.cycles;
                let frames = image.frames(address);
                let ours = frames
                    .iter()
                    .find(|it| it.function.contains("painleve_image"));
                sections.insert(Section {
                    cycles,
                    function: ours.map_or(name, |it| &it.function).to_owned(),
                    file: ours.map_or(String::new(), |it| it.file.clone()),
                    line: ours.map_or(0, |it| it.line),
                });
            }
        }
    }
    Ok(sections.into_iter().collect())
}

fn masks(instruction: &Instruction) -> bool {
    instruction.text.starts_with("msr basepri_max") || instruction.text.starts_with("cpsid")
}

fn unmasks(instruction: &Instruction) -> bool {
    let starts = ["msr basepri,", "msr primask", "cpsie"];
    starts.iter().any(|it| instruction.text.starts_with(it))
}

/// Returns the part of a graph from an instruction of a block, which masks, to the first that unmasks.
fn part(
    graph: &Graph,
    block: &Block,
    place: usize,
    panics: &BTreeSet<u32>,
) -> Result<Graph, BoundError> {
    let entry = block.instructions[place].address;
    let first = Block {
        instructions: block.instructions[place..].to_vec(),
        ..block.clone()
    };
    let mut blocks = BTreeMap::new();
    let mut open = vec![(entry, first)];
    while let Some((address, mut block)) = open.pop() {
        if let Some(end) = block.instructions.iter().position(unmasks) {
            block.instructions.truncate(end + 1);
            block.successors.clear();
            block.call = None;
            block.returns = true;
        } else if block.returns {
            return Err(BoundError::LeftMasked { address: entry });
        } else if block.call.is_some_and(|callee| panics.contains(&callee)) {
            block.successors.clear();
        }
        let mut others = block.instructions.iter().filter(|it| it.address != entry);
        if others.any(masks) {
            return Err(BoundError::MaskedTwice { address: entry });
        }
        for (to, _) in &block.successors {
            if !blocks.contains_key(to)
                && let Some(next) = graph.blocks.get(to)
            {
                open.push((*to, next.clone()));
            }
        }
        blocks.insert(address, block);
    }
    Ok(Graph { entry, blocks })
}

#[cfg(test)]
mod tests {
    use super::*;

    const AT: u32 = 0x0800_1000;

    /// A section that begins with the first instruction, and ends in the same block or in the next.
    fn part_of(code: &[u16]) -> Result<Graph, BoundError> {
        let code: Vec<u8> = code.iter().flat_map(|half| half.to_le_bytes()).collect();
        let image = Image::of_code(AT, &code, "section");
        let graph = Graph::of(&image, &Decoder::new()?, AT)?;
        part(&graph, &graph.blocks[&AT], 0, &BTreeSet::new())
    }

    const MASK: u16 = 0xb672; // cpsid i
    const UNMASK: u16 = 0xb662; // cpsie i
    const BRANCH: u16 = 0xe7ff; // b to the next instruction
    const RETURN: u16 = 0x4770; // bx lr

    #[test]
    fn a_section_ends_at_the_first_instruction_that_unmasks() {
        let graph = part_of(&[MASK, BRANCH, UNMASK, 0x2003, MASK, UNMASK, RETURN]).unwrap();
        let instructions = graph.blocks.values().map(|it| it.instructions.len());
        assert_eq!(instructions.sum::<usize>(), 3);
    }

    #[test]
    fn a_section_that_does_not_end_or_masks_twice_is_refused() {
        let left = part_of(&[MASK, BRANCH, RETURN]);
        assert!(matches!(left, Err(BoundError::LeftMasked { .. })));
        for nested in [
            vec![MASK, MASK, UNMASK, UNMASK, RETURN],
            vec![MASK, BRANCH, MASK, UNMASK, UNMASK, RETURN],
        ] {
            let nested = part_of(&nested);
            assert!(matches!(nested, Err(BoundError::MaskedTwice { .. })));
        }
    }
}

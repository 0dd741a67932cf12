//! How long loops go on: declared, because machine code does not say it.

use std::collections::BTreeSet;

use crate::graph::Graph;
use crate::image::Image;

/// Points of the belt that the governor looks at in a tick (`firmware/src/refer/governor`).
const POINTS_IN_A_HURRY: u32 = 2;

/// Segments of a reference (`firmware/src/refer/reference.rs`).
const MAXIMUM_SEGMENTS: u32 = 16;

/// How long a loop goes on once it is entered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Limit {
    /// At most so many rounds.
    Times(u32),
    /// At most so many cycles: it waits for the hardware.
    Cycles(u32),
}

/// One declaration.
#[derive(Clone, Debug)]
pub struct Declared {
    /// Part of the name of the function whose source holds the loop.
    pub function: &'static str,
    /// Its limit.
    pub limit: Limit,
    /// Why that is so.
    pub because: &'static str,
}

/// All declarations.
#[derive(Clone, Debug)]
pub struct Limits(pub Vec<Declared>);

impl Limits {
    /// Those of the control interrupt.
    pub fn of_control() -> Self {
        let declare = |function, limit, because| Declared {
            function,
            limit,
            because,
        };
        Self(vec![
            declare(
                "EdgeGovernor::search",
                Limit::Times(POINTS_IN_A_HURRY + 1),
                "two points of the belt a tick, and the look that finds no third",
            ),
            declare(
                "ReferenceGenerator::next_tick",
                Limit::Times(MAXIMUM_SEGMENTS + 1),
                "sixteen segments that take no time, and the look that finds no further one",
            ),
            declare(
                "check_send",
                Limit::Times(1),
                "the byte before has been read, so that there is room for the next",
            ),
            declare(
                "asm::delay",
                Limit::Cycles(5 * (475 * 168 / 1000 + 2)),
                "475 ns, the longest pause of the sensors' drivers, in rounds of at most five cycles",
            ),
            declare(
                "ForceCell",
                Limit::Cycles(8 * 128),
                "eight bits at 1.3125 MHz: APB1's 42 MHz over 32",
            ),
            declare(
                "check_read",
                Limit::Cycles(8 * 32),
                "eight bits at 5.25 MHz: APB2's 84 MHz over 16",
            ),
            declare("plausibility::", Limit::Times(3), "two joints, and the end"),
            declare(
                "div_rem",
                Limit::Times(64),
                "a division of 64 bits: at least a bit of the quotient a round",
            ),
            declare("set_bytes", Limit::Times(4), "a word's bytes at either end"),
            declare(
                "__aeabi_mem",
                Limit::Times(8),
                "sixteen bytes a round: no more than 128 are cleared or moved in a tick",
            ),
        ])
    }

    /// The limit of a loop that consists of these blocks: the first declaration whose function is
    /// among those, inlined or not, that the loop's instructions come from.
    pub fn of(&self, image: &Image, graph: &Graph, blocks: &BTreeSet<u32>) -> Option<Limit> {
        let mut all = Vec::new();
        for address in blocks {
            for instruction in &graph.blocks[address].instructions {
                all.extend(image.frames(instruction.address));
            }
        }
        let holds = |declared: &&Declared| {
            all.iter()
                .any(|frame| frame.function.contains(declared.function))
        };
        self.0.iter().find(holds).map(|declared| declared.limit)
    }
}

//! Limits of loops. They are declared, because the machine code does not contain them.

use std::collections::BTreeSet;

use crate::graph::Graph;
use crate::image::Image;

/// Points of the belt that the governor checks per tick (`firmware/src/refer/governor`).
const POINTS_IN_A_HURRY: u32 = 2;

/// Segments of a reference (`firmware/src/refer/reference.rs`).
const MAXIMUM_SEGMENTS: u32 = 16;

/// Limit of a loop, counted from its entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Limit {
    /// A number of iterations.
    Times(u32),
    /// A number of cycles, for a loop that waits for hardware.
    Cycles(u32),
}

/// One declaration.
#[derive(Clone, Debug)]
pub struct Declared {
    /// Part of the name of the function whose source holds the loop.
    pub function: &'static str,
    /// Its limit.
    pub limit: Limit,
    /// Reason for the limit.
    pub because: &'static str,
}

/// All declarations.
#[derive(Clone, Debug)]
pub struct Limits(pub Vec<Declared>);

impl Limits {
    /// Returns the declarations for the control interrupt.
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
                "two points of the belt per tick, and the check that ends the loop",
            ),
            declare(
                "ReferenceGenerator::next_tick",
                Limit::Times(MAXIMUM_SEGMENTS + 1),
                "sixteen segments without duration, and the check that ends the loop",
            ),
            declare(
                "sensor_bus::wait",
                Limit::Cycles(475 * 168 / 1000 + 30),
                "475 ns, the longest pause of the sensors' drivers, and one more look at the cycle counter",
            ),
            declare("plausibility::", Limit::Times(3), "two joints, and the end"),
            declare(
                "div_rem",
                Limit::Times(64),
                "a division of 64 bits: at least one bit of the quotient per iteration",
            ),
            declare("set_bytes", Limit::Times(4), "a word's bytes at either end"),
            declare(
                "__aeabi_mem",
                Limit::Times(8),
                "sixteen bytes per iteration: at most 128 are cleared or moved per tick",
            ),
        ])
    }

    /// Returns the limit of a loop that consists of these blocks: that of the first declaration
    /// whose function is a source function, inlined or not, of the loop's instructions.
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

//! Limits of loops and functions that are not called. They are declared, because the machine code does not contain them.

use std::collections::BTreeSet;

use painleve_drivers::encoders::EncoderDriver;
use painleve_drivers::exchange::{Dialogue, SelectTiming};
use painleve_drivers::force_cell::ForceCellDriver;
use painleve_firmware::refer::reference::MOST_ENDS;
use painleve_firmware::supervise::lapses::BOARD_LAPSES;

use crate::cycles::Chip;
use crate::graph::Graph;
use crate::image::{Frame, Image};

/// Bytes that the interrupts clear at once, at most; every call is checked.
pub const CLEARED_BYTES: u32 = 64;

/// Function that clears memory: its second argument is the number of bytes.
pub const CLEARS: &str = "__aeabi_memclr";

/// Functions that end the program: no path leads on from them.
const PANICS: &str = "core::panicking::";

/// Returns the functions of an image that end the program.
pub fn panics(image: &Image) -> BTreeSet<u32> {
    let panics = image.functions().filter(|(.., name)| name.contains(PANICS));
    panics.map(|(start, ..)| start).collect()
}

/// Functions that a tick does not call if the bound holds, with the reason. Each has to be out of line.
pub const NOT_CALLED: [(&str, &str); 4] = [
    (
        "::prolong_tick",
        "frames from the host that ask for an overrun: the stages are off",
    ),
    (
        "::note_overrun",
        "it handles a tick that ends after the next is due, at a higher control rate than is proved",
    ),
    (
        "::finish_late_tick",
        "it finishes a tick that has not ended when the next begins, at a higher control rate than is proved",
    ),
    (
        "::catch_up",
        "it does what a control task has already done: the update between two answers",
    ),
];

/// Function with which a control interrupt evaluates the model for the first readings. A tick that calls it [starts](STARTS).
pub const EVALUATES: &str = "Estimators::evaluate";

/// Functions that a tick does not call if its control interrupt [evaluates](EVALUATES) the model, with the reason. Each has
/// to be out of line.
pub const STARTS: [(&str, &str); 1] = [(
    "::learn",
    "the first readings show nothing about the torque before them",
)];

/// Limit of a loop, counted from its entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Limit {
    /// A number of executions of its first block: the iterations, plus one if the loop ends there.
    Times(u32),
    /// A number of cycles, for a loop that waits for hardware.
    Cycles(u32),
}

/// One declaration.
#[derive(Clone, Debug)]
pub struct Declared {
    /// Part of the name of the function whose source holds the loop.
    pub function: &'static str,
    /// Its limit; for iterations without the check that ends the loop.
    pub limit: Limit,
    /// Reason for the limit.
    pub because: &'static str,
}

/// All declarations.
#[derive(Clone, Debug)]
pub struct Limits(pub Vec<Declared>);

impl Limits {
    /// Returns the declarations for the interrupts of a tick: control and update.
    pub fn of_tick(chip: &Chip) -> Self {
        let declare = |function, limit, because| Declared {
            function,
            limit,
            because,
        };
        let longest_setup_ns = EncoderDriver::TIMING
            .setup_ns
            .max(ForceCellDriver::TIMING.setup_ns);
        Self(vec![
            declare(
                "ReferenceGenerator::prepare",
                Limit::Times(MOST_ENDS as u32),
                "segments that end per tick",
            ),
            declare(
                "::set_up",
                wait(chip, longest_setup_ns, 0.0),
                "the longer set-up time of the two buses, which are started together",
            ),
            declare(
                "OpenLoop::tick",
                Limit::Times(BOARD_LAPSES.len() as u32),
                "lapses that a board reports",
            ),
            declare("Plausibility::check", Limit::Times(2), "two joints"),
            declare("set_bytes", Limit::Times(3), "a word's bytes at either end"),
            declare(
                CLEARS,
                Limit::Times(CLEARED_BYTES / 16),
                "sixteen bytes per iteration, then three words and three bytes",
            ),
        ])
    }

    /// Returns the declarations for the interrupt of a sensor's bus: the times around an exchange, and half
    /// a period of the bus' clock, by which the last word comes early.
    pub fn of_sensor_bus(chip: &Chip, timing: SelectTiming, bus_hz: f64) -> Self {
        let declare = |function, limit| Declared {
            function,
            limit,
            because: "a time of the part's data sheet",
        };
        let half_period_ns = 0.5e9 / bus_hz;
        let mut all = vec![
            declare("::set_up", wait(chip, timing.setup_ns, 0.0)),
            declare("::hold", wait(chip, timing.hold_ns, half_period_ns)),
            declare("::pause", wait(chip, timing.pause_ns, 0.0)),
        ];
        all.extend(Self::of_tick(chip).0);
        Self(all)
    }

    /// Returns the limit of a loop that consists of these blocks: that of the first declaration whose function is a source
    /// function, inlined or not, of all branches back to its first block; the body may contain inlined functions. The first
    /// block is executed once more than the loop iterates, unless the loop ends only where it begins anew.
    pub fn of(
        &self,
        image: &Image,
        graph: &Graph,
        header: u32,
        blocks: &BTreeSet<u32>,
    ) -> Option<Limit> {
        let ends = blocks.iter().map(|address| &graph.blocks[address]);
        let ends = ends.filter(|block| block.successors.iter().any(|(to, _)| *to == header));
        let ends = ends.filter_map(|block| block.instructions.last());
        let ends: Vec<_> = ends.map(|it| image.frames(it.address)).collect();
        let holds = |declared: &&Declared| {
            let of = |frame: &Frame| frame.function.contains(declared.function);
            ends.iter().all(|frames| frames.iter().any(of))
        };
        let declared = self.0.iter().find(holds)?;
        match declared.limit {
            Limit::Times(times) if !ends_where_it_repeats(graph, header, blocks) => {
                Some(Limit::Times(times + 1))
            }
            limit => Some(limit),
        }
    }
}

/// Returns whether a loop is left only from blocks that may also begin it anew. Each execution of its first
/// block then belongs to one complete iteration.
fn ends_where_it_repeats(graph: &Graph, header: u32, blocks: &BTreeSet<u32>) -> bool {
    blocks.iter().all(|address| {
        let block = &graph.blocks[address];
        let successors = || block.successors.iter().map(|(to, _)| to);
        let leaves = block.returns || successors().any(|to| !blocks.contains(to));
        !leaves || successors().any(|to| *to == header)
    })
}

/// Returns the limit of a wait: the time, rounded up by the driver to whole cycles, and one more.
fn wait(chip: &Chip, time_ns: u32, early_ns: f64) -> Limit {
    let cycles = (f64::from(time_ns) + early_ns) * 1e-9 * chip.core_hz;
    Limit::Cycles(cycles.ceil() as u32 + 2)
}

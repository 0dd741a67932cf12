//! Records the executions of handlers.

use std::collections::{BTreeMap, BTreeSet};

use crate::system_control::Exception;

/// The executed instructions of some handlers, without those of the interrupts that interrupt them.
#[derive(Clone, Debug)]
pub(super) struct Trace {
    handlers: BTreeSet<u32>,
    /// Handlers that run, by their exceptions.
    running: BTreeMap<Exception, Vec<u32>>,
    /// The present instruction, if it is one of theirs.
    instruction: Option<u32>,
    pub(super) done: Vec<Vec<u32>>,
    /// The instructions that accessed peripherals, and the addresses that they accessed.
    pub(super) accesses: BTreeSet<(u32, u32)>,
}

impl Trace {
    /// Starts recording the handlers at these addresses.
    pub(super) fn new(handlers: &[u32]) -> Self {
        Self {
            handlers: handlers.iter().map(|it| it & !1).collect(),
            running: BTreeMap::new(),
            instruction: None,
            done: Vec::new(),
            accesses: BTreeSet::new(),
        }
    }

    /// Records that the present instruction accesses a peripheral.
    pub(super) fn access(&mut self, address: u32) {
        if let Some(instruction) = self.instruction {
            self.accesses.insert((instruction, address));
        }
    }

    /// Records an instruction that is about to be executed while these exceptions are active, the running one last.
    pub(super) fn step(&mut self, address: u32, active: &[Exception]) {
        let starts = self.handlers.contains(&address);
        let top = active.last();
        let done = &mut self.done;
        self.running.retain(|exception, instructions| {
            let runs = active.contains(exception) && !(starts && top == Some(exception));
            if !runs {
                done.push(std::mem::take(instructions));
            }
            runs
        });
        let instructions = match top {
            Some(exception) if starts => Some(self.running.entry(*exception).or_default()),
            Some(exception) => self.running.get_mut(exception),
            None => None,
        };
        self.instruction = instructions.map(|it| {
            it.push(address);
            address
        });
    }
}

//! Records the executions of a handler.

use std::collections::BTreeSet;

use crate::unicorn::{Processor, Register};

/// The executed instructions of one handler.
#[derive(Clone, Debug)]
pub(super) struct Trace {
    handler: u32,
    /// The stack pointer before the handler's first instruction, while the handler runs.
    stack: Option<u32>,
    now: Vec<u32>,
    pub(super) done: Vec<Vec<u32>>,
    /// The instructions that accessed peripherals, and the addresses that they accessed.
    pub(super) accesses: BTreeSet<(u32, u32)>,
}

impl Trace {
    /// Starts recording the handler at this address.
    pub(super) fn new(handler: u32) -> Self {
        Self {
            handler: handler & !1,
            stack: None,
            now: Vec::new(),
            done: Vec::new(),
            accesses: BTreeSet::new(),
        }
    }

    /// Records that the present instruction accesses a peripheral.
    pub(super) fn access(&mut self, address: u32) {
        if let (Some(_), Some(instruction)) = (self.stack, self.now.last()) {
            self.accesses.insert((*instruction, address));
        }
    }

    /// Records an instruction that is about to be executed.
    pub(super) fn step(&mut self, address: u32, processor: &Processor) {
        let stack = processor.get(Register::SP);
        if address == self.handler {
            self.stack = Some(stack);
        } else if self.stack.is_some_and(|before| stack >= before) {
            // The handler has removed its frame: the interrupted program or a tail-chained handler
            // follows.
            self.stack = None;
            self.done.push(std::mem::take(&mut self.now));
        }
        if self.stack.is_some() {
            self.now.push(address);
        }
    }
}

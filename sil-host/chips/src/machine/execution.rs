//! Execution: instructions, exceptions, sleep and resets until a time or a number of instructions is reached.

use super::core::Stop;
use super::exceptions::EXCEPTION_RETURN;
use super::{Chip, Machine, Reset};
use crate::Picoseconds;
use crate::system_control::HARD_FAULT;
use crate::unicorn::Register;

impl<C: Chip> Machine<C> {
    /// Runs for a given time.
    pub fn run_for(&mut self, time: Picoseconds) {
        self.run(self.now() + time, u64::MAX);
    }

    /// Runs a number of instructions, or until `limit` if the processor sleeps.
    pub fn run_instructions(&mut self, count: u64, limit: Picoseconds) {
        self.run(self.now() + limit, self.instructions() + count);
    }

    fn run(&mut self, limit: Picoseconds, instruction_limit: u64) {
        let core = self.unicorn.surroundings_mut();
        core.limit = limit;
        core.instruction_limit = instruction_limit;
        core.is_dirty = true;
        loop {
            self.protect();
            let address = self.unicorn.get(Register::PC);
            self.unicorn.surroundings_mut().stop = None;
            let result = self.unicorn.run(address);
            let address = self.unicorn.get(Register::PC);
            let core = self.unicorn.surroundings_mut();
            match (result, core.stop) {
                (Ok(()), Some(Stop::Limit)) => return,
                (Ok(()), Some(Stop::Exception(exception))) => self.enter(exception, address),
                (Ok(()), Some(Stop::Sleep)) => {
                    if !self.sleep() {
                        return;
                    }
                }
                (Ok(()), Some(Stop::Protection)) => {}
                (Ok(()), Some(Stop::Look)) => {
                    if core.system.reset_requested {
                        self.reset(Reset::Software);
                    } else if !core.chip.wants_reset() && !self.pass_time_to_next_event(true) {
                        return;
                    }
                }
                (Err(_), _) if address >= EXCEPTION_RETURN => self.leave(),
                (Ok(()), None) | (Err(_), _) => {
                    self.hard_faults += 1;
                    self.last_fault = Some((address, format!("{result:?}")));
                    assert!(
                        self.unicorn.surroundings().system.present_priority() >= 0,
                        "locked up at {address:#010x} ({}), {result:?}",
                        self.symbol_at(address),
                    );
                    if let Err(error) = result {
                        let system = &mut self.unicorn.surroundings_mut().system;
                        system.fault_status |= error.fault_status();
                    }
                    self.enter(HARD_FAULT, address);
                }
            }
            if let Some(reset) = self.chip_mut().take_reset() {
                self.reset(reset);
            }
        }
    }

    /// Waits for an interrupt; returns whether it came before the limit.
    fn sleep(&mut self) -> bool {
        loop {
            let core = self.unicorn.surroundings_mut();
            core.refresh();
            if core.candidate {
                let next = self.unicorn.get(Register::PC) + 2;
                self.unicorn.set(Register::PC, next);
                return true;
            }
            let is_clocked = core.chip.is_clocked_in_sleep();
            if !self.pass_time_to_next_event(is_clocked) {
                return false;
            }
            if let Some(reset) = self.chip_mut().take_reset() {
                self.reset(reset);
                return true;
            }
        }
    }

    /// Lets time pass without executing instructions; returns whether the limit has not been
    /// reached. The cycles count if the processor is clocked.
    fn pass_time_to_next_event(&mut self, is_clocked: bool) -> bool {
        let (core, processor) = self.unicorn.split();
        let until = core.next_event.min(core.limit).max(core.now);
        let hz = if is_clocked { core.chip.core_hz() } else { 0 };
        let passed = until - core.now;
        core.cycles += (u128::from(passed) * u128::from(hz) / u128::from(crate::SECOND)) as u64;
        core.now = until;
        core.advance(processor);
        core.now < core.limit
    }
}

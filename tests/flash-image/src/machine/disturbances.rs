//! Disturbances: interrupts, faults and changes of the memory from outside.

use super::{Chip, Machine};
use crate::system_control::{Exception, HARD_FAULT};
use crate::unicorn::Register;

impl<C: Chip> Machine<C> {
    /// Raises an interrupt, as its peripheral would.
    pub fn pend(&mut self, interrupt: usize) {
        let core = self.unicorn.surroundings_mut();
        core.system.pend(interrupt);
        core.is_dirty = true;
    }

    /// Returns whether an interrupt of this priority (upper bits of a byte, as in its register)
    /// would be taken now.
    pub fn would_take(&self, interrupt: usize) -> bool {
        let core = self.unicorn.surroundings();
        let mut system = core.system.clone();
        system.pend(interrupt);
        let primask = self.unicorn.get(Register::PRIMASK) & 1 != 0;
        let basepri = self.unicorn.get(Register::BASEPRI) as u8;
        core.conditional == 0 && system.next(primask, basepri, false) == Some(interrupt + 16)
    }

    /// Raises a hard fault, as an invalid instruction would.
    pub fn hard_fault(&mut self) {
        self.hard_faults += 1;
        let address = self.program_counter();
        self.enter(HARD_FAULT, address);
    }

    /// Raises an exception regardless of the interrupt controller, as a disturbance would.
    pub fn raise(&mut self, exception: Exception) {
        let address = self.program_counter();
        self.enter(exception, address);
    }

    /// Puts the program into an endless loop without interrupts.
    pub fn hang(&mut self) {
        // A branch to itself, in memory that the image leaves unused.
        let place = C::RAM.0;
        self.unicorn.processor().write_memory(place, &[0xfe, 0xe7]);
        self.unicorn.surroundings_mut().conditional = 0;
        self.unicorn.set(Register::PRIMASK, 1);
        self.unicorn.set(Register::PC, place);
    }

    /// Writes a word of memory, as a debugger would.
    pub fn write_word(&mut self, address: u32, word: u32) {
        self.unicorn
            .processor()
            .write_memory(address, &word.to_le_bytes());
    }
}

//! Disturbances: interrupts, faults and changes of the memory from outside.

use super::{Chip, Machine};
use crate::Picoseconds;
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

    /// Lets every instruction take this many cycles, as with a flash that is too slow.
    pub fn set_cycles_per_instruction(&mut self, cycles: u64) {
        let core = self.unicorn.surroundings_mut();
        core.cycles_per_instruction = cycles;
        core.is_dirty = true;
    }

    /// Delays every entry into an exception by a random time up to this one.
    pub fn set_latency(&mut self, longest: Picoseconds) {
        self.unicorn.surroundings_mut().latency.0 = longest;
    }

    /// Changes a bit of the flash wherever it holds this word; returns the number of places.
    pub fn flip_in_flash(&mut self, word: u32, bit: u32) -> usize {
        let flash = self.unicorn.surroundings().flash.clone();
        let (words, _) = flash.as_chunks::<4>();
        let places = words.iter().enumerate();
        let places: Vec<u32> = places
            .filter(|(_, it)| **it == word.to_le_bytes())
            .map(|(at, _)| C::FLASH.0 + 4 * at as u32)
            .collect();
        for place in &places {
            self.write_word(*place, word ^ 1 << bit);
        }
        places.len()
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
        self.unicorn.set(Register::PRIMASK, 1);
        // A branch to itself.
        self.execute(16, &[0xe7fe]);
    }

    /// Calls a function that stores registers on the stack and calls itself.
    pub fn recurse(&mut self) {
        self.execute(32, &[0xb5ff, 0xf7ff, 0xfffd]);
    }

    /// Stores a word at an address, and hangs.
    pub fn store(&mut self, address: u32) {
        let [low, high] = [address as u16, (address >> 16) as u16];
        // ldr r1, [pc, #4]; str r0, [r1]; b .
        self.execute(48, &[0x4901, 0x6008, 0xe7fe, 0, low, high]);
    }

    /// Executes instructions, in memory of the program that the image leaves unused: `before_end` bytes before its
    /// end, a place of their own, because Unicorn keeps what it has translated.
    fn execute(&mut self, before_end: u32, instructions: &[u16]) {
        let end = if C::ALIASED_RAM > 0 {
            C::ALIASED_RAM as u32
        } else {
            C::SLOTS.0
        };
        let place = end - before_end;
        let bytes: Vec<u8> = instructions
            .iter()
            .flat_map(|it| it.to_le_bytes())
            .collect();
        self.unicorn.processor().write_memory(place, &bytes);
        self.jump(place);
    }

    /// Continues at an address.
    pub fn jump(&mut self, address: u32) {
        self.unicorn.surroundings_mut().conditional = 0;
        self.unicorn.set(Register::PC, address);
    }

    /// Returns the stack pointer.
    pub fn stack_pointer(&self) -> u32 {
        self.unicorn.get(Register::SP)
    }

    /// Writes a word of memory, as a debugger would.
    pub fn write_word(&mut self, address: u32, word: u32) {
        self.unicorn
            .processor()
            .write_memory(address, &word.to_le_bytes());
    }
}

//! Disturbances: interrupts, faults and changes of the memory from outside.

use super::{Chip, Machine};
use crate::Picoseconds;
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
        let next = system.next(|| self.unicorn.processor().masks());
        core.conditional == 0 && next == Some(interrupt + 16)
    }

    /// Lets every instruction take this many cycles, as with a flash that is too slow.
    pub fn set_cycles_per_instruction(&mut self, cycles: u64) {
        let core = self.unicorn.surroundings_mut();
        core.cycles_per_instruction = cycles;
        core.is_dirty = true;
    }

    /// Delays every entry into an exception by a random time up to this one.
    pub fn set_latency(&mut self, longest: Picoseconds) {
        self.unicorn.surroundings_mut().latency = longest;
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

    /// Executes an instruction that is undefined; returns its address.
    pub fn execute_undefined(&mut self) -> u32 {
        self.execute(64, &[0xde00])
    }

    /// Enables an interrupt that no peripheral in use raises, and raises it.
    pub fn raise_unexpected(&mut self) {
        // ldr r1, [pc, #12]; ldr r2, [pc, #16]; movs r0, #1; lsls r0, #8; str r0, [r1]; str r0, [r2]; b .
        // Interrupt 40 in the second registers of the interrupt controller that enable and that raise.
        let registers = [0xe104, 0xe000, 0xe204, 0xe000];
        let code = [0x4903, 0x4a04, 0x2001, 0x0200, 0x6008, 0x6010, 0xe7fe, 0];
        self.execute(96, &[&code[..], &registers].concat());
    }

    /// Puts the program into an endless loop without interrupts.
    pub fn hang(&mut self) {
        // cpsid i; b .
        self.execute(16, &[0xb672, 0xe7fe]);
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
    /// end, a place of their own, because Unicorn keeps what it has translated. Returns the place.
    fn execute(&mut self, before_end: u32, instructions: &[u16]) -> u32 {
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
        place
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

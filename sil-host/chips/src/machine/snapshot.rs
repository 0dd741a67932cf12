//! The complete state of a machine at one instant.

use super::core::Core;
use super::{Chip, Machine, Reset};
use crate::Picoseconds;
use crate::unicorn::Register;

/// State of a machine at one instant.
#[derive(Clone)]
pub struct MachineSnapshot<C> {
    core: Core<C>,
    registers: Vec<u32>,
    ram: Vec<u8>,
    resets: Vec<(Picoseconds, Reset)>,
}

impl<C> MachineSnapshot<C> {
    /// Returns the program counter.
    pub fn program_counter(&self) -> u32 {
        // After the thirteen numbered registers, the stack pointer and the link register.
        self.registers[15]
    }
}

/// The registers of the processor.
pub(super) fn registers() -> impl Iterator<Item = Register> {
    let special = [
        Register::SP,
        Register::LR,
        Register::PC,
        Register::XPSR,
        Register::PRIMASK,
        Register::BASEPRI,
        Register::FAULTMASK,
        Register::FPSCR,
    ];
    (0..13)
        .map(Register::r)
        .chain(special)
        .chain((0..32).map(Register::s))
}

impl<C: Chip> Machine<C> {
    /// Returns the complete state.
    pub fn snapshot(&self) -> MachineSnapshot<C> {
        let mut ram = vec![0; C::RAM.1];
        self.unicorn.processor().read_memory(C::RAM.0, &mut ram);
        MachineSnapshot {
            core: self.unicorn.surroundings().clone(),
            registers: registers().map(|it| self.unicorn.get(it)).collect(),
            ram,
            resets: self.resets.clone(),
        }
    }

    /// Restores a snapshot.
    pub fn restore(&mut self, snapshot: &MachineSnapshot<C>) {
        *self.unicorn.surroundings_mut() = snapshot.core.clone();
        self.resets.clone_from(&snapshot.resets);
        self.unicorn
            .processor()
            .write_memory(C::RAM.0, &snapshot.ram);
        for (register, value) in registers().zip(&snapshot.registers) {
            self.unicorn.set(register, *value);
        }
    }
}

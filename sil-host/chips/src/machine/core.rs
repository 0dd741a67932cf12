//! The state of a machine around its processor, which decides before each instruction whether it is executed.

use std::sync::Arc;

use super::Chip;
use super::systick::SysTick;
use super::trace::Trace;
use crate::Picoseconds;
use crate::registers::Registers;
use crate::system_control::{Exception, SystemControl};
use crate::unicorn::{Processor, Surroundings};

/// Addresses of the SysTick timer.
const SYSTICK: std::ops::Range<u32> = 0xe000_e010..0xe000_e020;

/// Addresses of the chip's peripherals, and of its debug unit.
const PERIPHERALS: [std::ops::Range<u32>; 2] = [0x4000_0000..0x6000_0000, 0xe004_0000..0xe010_0000];

/// Why [`Core::before_instruction`] stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stop {
    Exception(Exception),
    Limit,
    Sleep,
    Look,
    /// What the memory may be used for has changed.
    Protection,
}

/// The state of the machine except registers and memory.
#[derive(Clone)]
pub(super) struct Core<C> {
    pub(super) chip: C,
    pub(super) registers: Arc<Registers>,
    pub(super) system: SystemControl,
    pub(super) flash: Arc<[u8]>,
    /// The program that the image copies to the RAM at address 0.
    pub(super) program: Arc<[u8]>,
    pub(super) now: Picoseconds,
    pub(super) cycles: u64,
    pub(super) instructions: u64,
    pub(super) instruction_ps: Picoseconds,
    pub(super) cycles_per_instruction: u64,
    pub(super) systick: SysTick,
    /// Largest delay of the entry into an exception, by a defect.
    pub(super) latency: Picoseconds,
    /// State of the random numbers.
    pub(super) random: u64,
    pub(super) next_event: Picoseconds,
    pub(super) limit: Picoseconds,
    pub(super) instruction_limit: u64,
    /// Remaining instructions of a conditional block, which is not interrupted because Unicorn does
    /// not keep the block's state.
    pub(super) conditional: u32,
    pub(super) stop: Option<Stop>,
    /// Addresses of the instructions of traced handlers.
    pub(super) trace: Option<Trace>,
    /// Whether the next exception may have changed.
    pub(super) is_dirty: bool,
    pub(super) candidate: bool,
    /// Whether what the memory may be used for has changed.
    pub(super) is_reprotected: bool,
}

impl<C: Chip> Core<C> {
    pub(super) fn refresh(&mut self) {
        self.system.set_lines(self.chip.interrupt_lines());
        self.system.nmi_pending |= self.chip.take_nmi();
        self.system.systick_pending |= std::mem::take(&mut self.systick.is_pending);
        self.candidate = self.system.wakes();
        let hz = self.chip.core_hz();
        let cycles = crate::SECOND * self.cycles_per_instruction;
        self.instruction_ps = cycles.checked_div(hz).unwrap_or(0);
        self.next_event = self.chip.next_event().min(self.systick.next_event());
        self.is_dirty = false;
    }

    pub(super) fn advance(&mut self, memory: &Processor) {
        self.chip.advance(self.now, memory);
        self.systick.advance(self.chip.core_hz(), self.now);
        self.refresh();
    }

    /// Checks that the chip has what is loaded or, with a value, stored.
    fn check(&self, address: u32, size: u32, stored: Option<u32>) {
        if PERIPHERALS.iter().any(|it| it.contains(&address)) {
            self.registers.check(address, size, stored);
        }
    }

    /// Returns random bits: the upper half of Knuth's linear congruential generator.
    pub(super) fn random(&mut self) -> u32 {
        self.random = self
            .random
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (self.random >> 32) as u32
    }

    fn exception(&self, processor: &Processor) -> Option<Exception> {
        self.system.next(|| processor.masks())
    }

    fn opcode(&self, address: u32) -> u16 {
        let at = address as usize;
        let bytes = if at < C::ALIASED_RAM {
            self.program.get(at..at + 2)
        } else {
            let at = address.wrapping_sub(C::FLASH.0) as usize;
            self.flash.get(at..at + 2)
        };
        bytes.map_or(0, |it| u16::from_le_bytes([it[0], it[1]]))
    }
}

impl<C: Chip> Surroundings for Core<C> {
    fn before_instruction(&mut self, address: u32, processor: &Processor) -> bool {
        if self.is_dirty {
            self.refresh();
        }
        assert!(
            address as usize >= C::ALIASED_RAM || self.chip.ram_is_at_zero(),
            "{address:#010x} is executed before the RAM is mapped to it"
        );
        assert!(
            address < C::FLASH.0 || address >= C::RAM.0 || !self.chip.flash_is_stalled(self.now),
            "{address:#010x} is executed while the flash is busy"
        );
        let mut stop = None;
        if self.conditional == 0 {
            if self.candidate {
                stop = self.exception(processor).map(Stop::Exception);
            }
            if self.now >= self.limit || self.instructions >= self.instruction_limit {
                stop = Some(Stop::Limit);
            } else if self.instruction_ps == 0
                || self.system.reset_requested
                || self.chip.wants_reset()
            {
                stop = Some(Stop::Look);
            }
            if std::mem::take(&mut self.is_reprotected) {
                stop = Some(Stop::Protection);
            }
        }
        let opcode = self.opcode(address);
        if stop.is_none() && opcode == 0xbf30 {
            stop = Some(Stop::Sleep);
        }
        if stop.is_some() {
            self.stop = stop;
            return false;
        }
        if opcode & 0xff00 == 0xbf00 && opcode & 0xf != 0 {
            self.conditional = 4 - (opcode & 0xf).trailing_zeros();
        } else {
            self.conditional = self.conditional.saturating_sub(1);
        }
        if let Some(trace) = &mut self.trace {
            trace.step(address, &self.system.active);
        }
        self.instructions += 1;
        self.cycles += self.cycles_per_instruction;
        self.now += self.instruction_ps;
        if self.now >= self.next_event {
            self.advance(processor);
        }
        true
    }

    fn read(&mut self, address: u32, size: u32, _: &Processor) -> u32 {
        self.is_dirty = true;
        if let Some(trace) = &mut self.trace {
            trace.access(address);
        }
        if SYSTICK.contains(&address) {
            self.systick.read(address)
        } else if (0xe000_0000..0xe004_0000).contains(&address) {
            self.system.read(address, self.cycles)
        } else {
            self.check(address, size, None);
            self.chip.read(address, size, self.now)
        }
    }

    fn write(&mut self, address: u32, size: u32, value: u32, _: &Processor) {
        self.is_dirty = true;
        if let Some(trace) = &mut self.trace {
            trace.access(address);
        }
        if SYSTICK.contains(&address) {
            let hz = self.chip.core_hz();
            self.systick.write(address, value, hz, self.now);
        } else if (0xe000_0000..0xe004_0000).contains(&address) {
            self.system.write(address, size, value, self.cycles);
            self.is_reprotected |= address == 0xe000_ed94;
        } else {
            self.check(address, size, Some(value));
            let value = if PERIPHERALS[0].contains(&address) {
                self.registers.on_the_bus(address, size, value)
            } else {
                value
            };
            self.chip.write(address, size, value, self.now);
        }
    }
}

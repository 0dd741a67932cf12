//! A microcontroller that executes an image: exceptions, sleep, resets and time around
//! [`unicorn`](crate::unicorn).

mod core;
mod disturbances;
mod exceptions;
mod execution;
mod program;
mod snapshot;
mod systick;
mod trace;

use std::collections::BTreeSet;
use std::path::Path;

use self::core::Core;
use self::program::Program;
pub use self::snapshot::MachineSnapshot;
use self::snapshot::registers;
use self::systick::SysTick;
use self::trace::Trace;
use crate::Picoseconds;
use crate::protection::EVERYTHING;
use crate::registers::Registers;
use crate::system_control::SystemControl;
use crate::unicorn::{Processor, Register, Unicorn};

/// Cycles per instruction, a conservative value for code in flash behind the accelerator. No
/// assertion depends on its exact value.
pub const CYCLES_PER_INSTRUCTION: u64 = 2;

/// The microcontroller's peripherals, with the parts on its pins.
pub trait Chip: Clone {
    /// Start and length of its flash.
    const FLASH: (u32, usize);
    /// Start and length of the part of the flash that can be changed, its end.
    const SLOTS: (u32, usize);
    /// Start and length of its RAM.
    const RAM: (u32, usize);
    /// Bytes of the RAM that can be mapped to address 0, where the flash is otherwise.
    const ALIASED_RAM: usize;
    /// Table of the [registers](crate::registers) of its peripherals.
    const REGISTERS: &'static str;

    /// Resets the peripherals for the given cause.
    fn reset(&mut self, reset: Reset, now: Picoseconds);

    /// Returns the value of a load from a peripheral.
    fn read(&mut self, address: u32, size: u32, now: Picoseconds) -> u32;

    /// Performs a store to a peripheral.
    fn write(&mut self, address: u32, size: u32, value: u32, now: Picoseconds);

    /// Performs all due events, with access to memory for DMA.
    fn advance(&mut self, now: Picoseconds, memory: &Processor);

    /// Returns the time of the next event.
    fn next_event(&self) -> Picoseconds;

    /// Returns the interrupt lines, one bit each.
    fn interrupt_lines(&self) -> u128;

    /// Takes a pending non-maskable interrupt.
    fn take_nmi(&mut self) -> bool;

    /// Returns whether a reset is pending.
    fn wants_reset(&self) -> bool;

    /// Takes a pending reset.
    fn take_reset(&mut self) -> Option<Reset>;

    /// Returns the processor's clock, Hz; 0 if it has stopped.
    fn core_hz(&self) -> u64;

    /// Returns whether the processor's own clock runs on while it sleeps (DBGMCU_CR: DBG_SLEEP). Without it, the cycle
    /// counter stands still.
    fn is_clocked_in_sleep(&self) -> bool;

    /// Returns whether the flash is busy, so that no instruction and no vector can be read from it.
    fn flash_is_stalled(&self, now: Picoseconds) -> bool {
        let _ = now;
        false
    }

    /// Returns whether the RAM, rather than the flash, is mapped to address 0.
    fn ram_is_at_zero(&self) -> bool;
}

/// Cause of a reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reset {
    /// Power came up.
    Power,
    /// The supply was too low.
    BrownOut,
    /// The independent watchdog was not fed.
    Watchdog,
    /// The window watchdog was not fed.
    WindowWatchdog,
    /// The program requested it.
    Software,
    /// The reset pin was low.
    Pin,
}

/// A microcontroller with an image in its flash.
pub struct Machine<C: Chip> {
    unicorn: Unicorn<Core<C>>,
    symbols: Vec<(String, u32)>,
    /// Blocks of memory, and what Unicorn permits there.
    memory: Vec<((u32, usize), u32)>,
    /// Resets since power-up, including the first.
    pub resets: Vec<(Picoseconds, Reset)>,
    /// Number of hard faults.
    pub hard_faults: u32,
    /// Address of the last hard fault, and Unicorn's error.
    pub last_fault: Option<(u32, String)>,
}

impl<C: Chip> Machine<C> {
    /// Programs an image and powers the machine up; nothing has been executed.
    ///
    /// # Panics
    /// If image or library cannot be used.
    pub fn new(library: &Path, image: &Path, chip: C) -> Self {
        let Program {
            flash,
            in_ram: program,
            symbols,
        } = Program::read::<C>(image);
        let core = Core {
            chip,
            registers: Registers::parse(C::REGISTERS).into(),
            system: SystemControl::new(),
            flash: flash.as_slice().into(),
            program: program.into(),
            now: 0,
            cycles: 0,
            instructions: 0,
            instruction_ps: 0,
            cycles_per_instruction: CYCLES_PER_INSTRUCTION,
            systick: SysTick::default(),
            latency: 0,
            random: 1,
            next_event: 0,
            limit: 0,
            instruction_limit: u64::MAX,
            conditional: 0,
            stop: None,
            trace: None,
            is_dirty: true,
            candidate: false,
            is_reprotected: false,
        };
        let mut unicorn = Unicorn::new(library, core)
            .unwrap_or_else(|error| panic!("{}: {error}", library.display()));
        let mut memory = vec![(C::FLASH.0, C::FLASH.1 - C::SLOTS.1)];
        unicorn.map(C::FLASH.0, C::FLASH.1 - C::SLOTS.1);
        if C::ALIASED_RAM > 0 {
            memory.extend([(C::RAM.0, C::ALIASED_RAM), (0, C::ALIASED_RAM)]);
            unicorn.map_with_alias(C::RAM.0, C::ALIASED_RAM, 0);
        }
        let rest = (C::RAM.0 + C::ALIASED_RAM as u32, C::RAM.1 - C::ALIASED_RAM);
        memory.push(rest);
        unicorn.map(rest.0, rest.1);
        unicorn.map_peripherals(&[
            (C::SLOTS.0, C::SLOTS.1 as u32),
            (0x4000_0000, 0x0010_0000),
            (0x4200_0000, 0x0200_0000),
            (0x4800_0000, 0x0000_2000),
            (0x5000_0000, 0x0000_2000),
            (0x1fff_7000, 0x0000_1000),
            (0xe000_0000, 0x0010_0000),
        ]);
        let program = &flash[..C::FLASH.1 - C::SLOTS.1];
        unicorn.processor().write_memory(C::FLASH.0, program);
        let mut machine = Self {
            unicorn,
            symbols,
            resets: Vec::new(),
            memory: memory.into_iter().map(|it| (it, EVERYTHING)).collect(),
            hard_faults: 0,
            last_fault: None,
        };
        machine.reset(Reset::Power);
        machine
    }

    /// Returns the peripherals.
    pub fn chip(&self) -> &C {
        &self.unicorn.surroundings().chip
    }

    /// Returns the peripherals, to change their surroundings.
    pub fn chip_mut(&mut self) -> &mut C {
        let core = self.unicorn.surroundings_mut();
        core.is_dirty = true;
        &mut core.chip
    }

    /// Returns the time since power-up.
    pub fn now(&self) -> Picoseconds {
        self.unicorn.surroundings().now
    }

    /// Returns the number of instructions executed since power-up.
    pub fn instructions(&self) -> u64 {
        self.unicorn.surroundings().instructions
    }

    /// Starts recording the addresses of the instructions of these handlers.
    pub fn trace(&mut self, handlers: &[u32]) {
        self.unicorn.surroundings_mut().trace = Some(Trace::new(handlers));
    }

    /// Returns the executions of traced handlers since the last call, in the order of their ends. Each begins with the
    /// handler's address.
    pub fn take_traces(&mut self) -> Vec<Vec<u32>> {
        let trace = self.unicorn.surroundings_mut().trace.as_mut();
        trace.map_or_else(Vec::new, |trace| std::mem::take(&mut trace.done))
    }

    /// Returns the instructions of traced handlers that accessed peripherals, each with an address that it accessed.
    pub fn peripheral_accesses(&self) -> BTreeSet<(u32, u32)> {
        let trace = self.unicorn.surroundings().trace.as_ref();
        trace.map_or_else(BTreeSet::new, |trace| trace.accesses.clone())
    }

    /// Lets Unicorn permit what the memory protection unit permits.
    fn protect(&mut self) {
        for (block, permitted) in &mut self.memory {
            let (start, length) = *block;
            let system = &self.unicorn.surroundings().system;
            let ends = [start, start + length as u32 - 4].map(|it| system.permits(it));
            assert_eq!(ends[0], ends[1], "a part of the memory at {start:#010x}");
            if *permitted != ends[0] {
                *permitted = ends[0];
                self.unicorn.protect(start, length, *permitted);
            }
        }
    }

    /// Returns the program counter.
    pub fn program_counter(&self) -> u32 {
        self.unicorn.get(Register::PC)
    }

    /// Returns the symbol that contains an address, for messages.
    pub fn symbol_at(&self, address: u32) -> &str {
        let below = self.symbols.iter().filter(|(_, it)| it & !1 <= address);
        below
            .max_by_key(|(_, it)| *it)
            .map_or("?", |(name, _)| name)
    }

    /// Returns the address of a symbol.
    pub fn symbol(&self, name: &str) -> Option<u32> {
        let found = self.symbols.iter().find(|(it, _)| it == name);
        found.map(|(_, address)| *address)
    }

    /// Resets the microcontroller; memory keeps its contents unless the supply has failed.
    pub fn reset(&mut self, reset: Reset) {
        let core = self.unicorn.surroundings_mut();
        core.chip.reset(reset, core.now);
        core.system = SystemControl::new();
        core.systick = SysTick::default();
        core.conditional = 0;
        core.refresh();
        let now = core.now;
        self.resets.push((now, reset));
        if matches!(reset, Reset::Power | Reset::BrownOut) {
            let ram = (0..C::RAM.1 / 4).flat_map(|_| core.random().to_le_bytes());
            let ram: Vec<u8> = ram.collect();
            self.unicorn.processor().write_memory(C::RAM.0, &ram);
        }
        let mut vectors = [0; 8];
        self.unicorn
            .processor()
            .read_memory(C::FLASH.0, &mut vectors);
        let [a, b, c, d, e, f, g, h] = vectors;
        for register in registers() {
            self.unicorn.set(register, 0);
        }
        self.unicorn.set(Register::XPSR, 1 << 24);
        self.unicorn.set(Register::LR, u32::MAX);
        self.unicorn
            .set(Register::SP, u32::from_le_bytes([a, b, c, d]));
        self.unicorn
            .set(Register::PC, u32::from_le_bytes([e, f, g, h]));
    }
}

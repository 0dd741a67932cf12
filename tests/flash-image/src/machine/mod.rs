//! A microcontroller that executes an image: exceptions, sleep, resets and time around
//! [`unicorn`](crate::unicorn).

mod exceptions;
mod program;
mod trace;

use std::path::Path;
use std::sync::Arc;

use self::exceptions::EXCEPTION_RETURN;
use self::program::Program;
use self::trace::Trace;
use crate::Picoseconds;
use crate::system_control::{Exception, HARD_FAULT, SystemControl};
use crate::unicorn::{Processor, Register, Surroundings, Unicorn};

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
    /// The program requested it.
    Software,
    /// The reset pin was low.
    Pin,
}

/// Why [`Core::before_instruction`] stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stop {
    Exception(Exception),
    Limit,
    Sleep,
    Look,
}

/// The state of the machine except registers and memory.
#[derive(Clone)]
struct Core<C> {
    chip: C,
    system: SystemControl,
    flash: Arc<[u8]>,
    /// The program that the image copies to the RAM at address 0.
    program: Arc<[u8]>,
    now: Picoseconds,
    cycles: u64,
    instructions: u64,
    instruction_ps: Picoseconds,
    next_event: Picoseconds,
    limit: Picoseconds,
    instruction_limit: u64,
    /// Remaining instructions of a conditional block, which is not interrupted because Unicorn does
    /// not keep the block's state.
    conditional: u32,
    stop: Option<Stop>,
    /// Addresses of the instructions of a traced handler, starting with its first.
    trace: Option<Trace>,
    /// Whether the next exception may have changed.
    is_dirty: bool,
    candidate: bool,
}

impl<C: Chip> Core<C> {
    fn refresh(&mut self) {
        self.system.set_lines(self.chip.interrupt_lines());
        self.system.nmi_pending |= self.chip.take_nmi();
        self.candidate = self.system.wakes();
        let hz = self.chip.core_hz();
        let cycles = crate::SECOND * CYCLES_PER_INSTRUCTION;
        self.instruction_ps = cycles.checked_div(hz).unwrap_or(0);
        self.next_event = self.chip.next_event();
        self.is_dirty = false;
    }

    fn advance(&mut self, memory: &Processor) {
        self.chip.advance(self.now, memory);
        self.refresh();
    }

    fn exception(&self, processor: &Processor) -> Option<Exception> {
        self.system.next(
            processor.get(Register::PRIMASK) & 1 != 0,
            processor.get(Register::BASEPRI) as u8,
            processor.get(Register::FAULTMASK) & 1 != 0,
        )
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
            trace.step(address, processor);
        }
        self.instructions += 1;
        self.cycles += CYCLES_PER_INSTRUCTION;
        self.now += self.instruction_ps;
        if self.now >= self.next_event {
            self.advance(processor);
        }
        true
    }

    fn read(&mut self, address: u32, size: u32, _: &Processor) -> u32 {
        self.is_dirty = true;
        if (0xe000_0000..0xe004_0000).contains(&address) {
            self.system.read(address, self.cycles)
        } else {
            self.chip.read(address, size, self.now)
        }
    }

    fn write(&mut self, address: u32, size: u32, value: u32, _: &Processor) {
        self.is_dirty = true;
        if (0xe000_0000..0xe004_0000).contains(&address) {
            self.system.write(address, size, value, self.cycles);
        } else {
            self.chip.write(address, size, value, self.now);
        }
    }
}

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

/// A microcontroller with an image in its flash.
pub struct Machine<C: Chip> {
    unicorn: Unicorn<Core<C>>,
    symbols: Vec<(String, u32)>,
    /// Resets since power-up, including the first.
    pub resets: Vec<(Picoseconds, Reset)>,
    /// Number of hard faults.
    pub hard_faults: u32,
    /// Address of the last hard fault, and Unicorn's error.
    pub last_fault: Option<(u32, String)>,
}

fn registers() -> impl Iterator<Item = Register> {
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
            system: SystemControl::new(),
            flash: flash.as_slice().into(),
            program: program.into(),
            now: 0,
            cycles: 0,
            instructions: 0,
            instruction_ps: 0,
            next_event: 0,
            limit: 0,
            instruction_limit: u64::MAX,
            conditional: 0,
            stop: None,
            trace: None,
            is_dirty: true,
            candidate: false,
        };
        let mut unicorn = Unicorn::new(library, core)
            .unwrap_or_else(|error| panic!("{}: {error}", library.display()));
        unicorn.map(C::FLASH.0, C::FLASH.1 - C::SLOTS.1);
        if C::ALIASED_RAM > 0 {
            unicorn.map_with_alias(C::RAM.0, C::RAM.1, 0, C::ALIASED_RAM);
        } else {
            unicorn.map(C::RAM.0, C::RAM.1);
        }
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

    /// Starts recording the addresses of the instructions of a handler.
    pub fn trace(&mut self, handler: u32) {
        self.unicorn.surroundings_mut().trace = Some(Trace::new(handler));
    }

    /// Returns the executions of the traced handler since the last call.
    pub fn take_traces(&mut self) -> Vec<Vec<u32>> {
        let trace = self.unicorn.surroundings_mut().trace.as_mut();
        trace.map_or_else(Vec::new, |trace| std::mem::take(&mut trace.done))
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

    /// Resets the microcontroller; memory keeps its contents.
    pub fn reset(&mut self, reset: Reset) {
        let core = self.unicorn.surroundings_mut();
        core.chip.reset(reset, core.now);
        core.system = SystemControl::new();
        core.conditional = 0;
        core.refresh();
        let now = core.now;
        self.resets.push((now, reset));
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

    /// Runs for a given time.
    pub fn run_for(&mut self, time: Picoseconds) {
        self.run(self.now() + time, u64::MAX);
    }

    /// Runs a number of instructions, or until `limit` if the processor sleeps.
    pub fn run_instructions(&mut self, count: u64, limit: Picoseconds) {
        self.run(self.now() + limit, self.instructions() + count);
    }

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

    /// Returns the address of a symbol.
    pub fn symbol(&self, name: &str) -> Option<u32> {
        let found = self.symbols.iter().find(|(it, _)| it == name);
        found.map(|(_, address)| *address)
    }

    /// Writes a word of memory, as a debugger would.
    pub fn write_word(&mut self, address: u32, word: u32) {
        self.unicorn
            .processor()
            .write_memory(address, &word.to_le_bytes());
    }

    fn run(&mut self, limit: Picoseconds, instruction_limit: u64) {
        let core = self.unicorn.surroundings_mut();
        core.limit = limit;
        core.instruction_limit = instruction_limit;
        core.is_dirty = true;
        loop {
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
                (Ok(()), Some(Stop::Look)) => {
                    if core.system.reset_requested {
                        self.reset(Reset::Software);
                    } else if !core.chip.wants_reset() && !self.pass_time_to_next_event() {
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
            if !self.pass_time_to_next_event() {
                return false;
            }
            if let Some(reset) = self.chip_mut().take_reset() {
                self.reset(reset);
                return true;
            }
        }
    }

    /// Lets time pass without executing instructions; returns whether the limit has not been
    /// reached.
    fn pass_time_to_next_event(&mut self) -> bool {
        let (core, processor) = self.unicorn.split();
        let until = core.next_event.min(core.limit).max(core.now);
        let hz = core.chip.core_hz();
        let passed = until - core.now;
        core.cycles += (u128::from(passed) * u128::from(hz) / u128::from(crate::SECOND)) as u64;
        core.now = until;
        core.advance(processor);
        core.now < core.limit
    }
}

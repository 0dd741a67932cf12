//! The core peripherals: interrupt controller, system control block, cycle counter.

use crate::protection::Protection;

/// Number of interrupts, in addition to the sixteen exceptions.
pub const INTERRUPTS: usize = 96;

/// Number of an exception: 2 NMI, 3 hard fault, 15 SysTick, 16 and up interrupts.
pub type Exception = usize;

/// Non-maskable interrupt.
pub const NMI: Exception = 2;
/// Hard fault.
pub const HARD_FAULT: Exception = 3;

/// The SysTick timer's exception.
const SYSTICK: Exception = 15;

/// Bit of DEMCR that switches the trace unit on.
const TRACE_ON: u32 = 1 << 24;

/// Implemented bits of a priority, from the top of its byte.
const PRIORITY_MASK: u8 = 0xf0;

/// The processor's registers that mask exceptions.
#[derive(Clone, Copy)]
pub struct Masks {
    /// Masks all but hard faults and the non-maskable interrupt.
    pub primask: bool,
    /// Masks exceptions of this priority and less urgent ones, unless 0.
    pub basepri: u8,
    /// Masks all but the non-maskable interrupt.
    pub faultmask: bool,
}

/// Registers of the core peripherals.
#[derive(Clone)]
pub struct SystemControl {
    enabled: u128,
    latched: u128,
    lines: u128,
    priorities: [u8; INTERRUPTS],
    system_priorities: [u8; 16],
    /// Exceptions being handled, the innermost last.
    pub active: Vec<Exception>,
    /// Whether a non-maskable interrupt is pending.
    pub nmi_pending: bool,
    /// Whether the SysTick timer's exception is pending.
    pub systick_pending: bool,
    /// Address of the vector table; 0 after a reset.
    pub vector_table: u32,
    /// Whether a reset has been requested.
    pub reset_requested: bool,
    /// Whether the cycle counter is enabled, its count when it was last written, and the cycle of that.
    cycle_counter_enabled: bool,
    count: u32,
    counted_from: u64,
    /// Debug exception and monitor control (DEMCR).
    trace: u32,
    coprocessor_access: u32,
    floating_point_context: u32,
    system_control: u32,
    /// The memory protection unit.
    pub protection: Protection,
    /// Configurable fault status.
    pub fault_status: u32,
}

impl Default for SystemControl {
    fn default() -> Self {
        Self::new()
    }
}

impl SystemControl {
    /// Creates the registers in their reset state.
    pub fn new() -> Self {
        Self {
            enabled: 0,
            latched: 0,
            lines: 0,
            priorities: [0; INTERRUPTS],
            system_priorities: [0; 16],
            active: Vec::new(),
            nmi_pending: false,
            systick_pending: false,
            vector_table: 0,
            reset_requested: false,
            cycle_counter_enabled: false,
            count: 0,
            counted_from: 0,
            trace: 0,
            coprocessor_access: 0,
            floating_point_context: 0xc000_0000,
            system_control: 0,
            protection: Protection::default(),
            fault_status: 0,
        }
    }

    /// Records the peripherals' interrupt lines.
    pub fn set_lines(&mut self, lines: u128) {
        self.latched |= lines & !self.lines;
        self.lines = lines;
    }

    /// Raises an interrupt as a peripheral would, regardless of its line.
    pub fn pend(&mut self, interrupt: usize) {
        self.latched |= 1 << interrupt;
    }

    fn pending(&self) -> u128 {
        let active = self.active.iter().filter(|it| **it >= 16);
        let active = active.fold(0_u128, |bits, it| bits | 1 << (it - 16));
        self.enabled & (self.latched | (self.lines & !active))
    }

    /// Returns whether any exception would wake the processor.
    pub fn wakes(&self) -> bool {
        self.nmi_pending || self.systick_pending || self.pending() != 0
    }

    fn priority(&self, exception: Exception) -> i32 {
        match exception {
            NMI => -2,
            HARD_FAULT => -1,
            system @ 0..16 => self.system_priorities[system].into(),
            interrupt => (self.priorities[interrupt - 16] & PRIORITY_MASK).into(),
        }
    }

    /// Returns the priority at which the processor runs, without masks; 256 for none.
    pub fn present_priority(&self) -> i32 {
        let active = self.active.iter().map(|it| self.priority(*it));
        active.min().unwrap_or(256)
    }

    /// Returns what may be done at an address.
    pub fn permits(&self, address: u32) -> u32 {
        self.protection.permits(address, self.present_priority())
    }

    /// Returns the next exception, if masks and present priority allow it. The masks are asked for
    /// only if the present priority does.
    pub fn next(&self, masks: impl FnOnce() -> Masks) -> Option<Exception> {
        let present = self.present_priority();
        if self.nmi_pending && present > self.priority(NMI) {
            return Some(NMI);
        }
        let mut pending = self.pending();
        let mut best = self
            .systick_pending
            .then(|| (SYSTICK, self.priority(SYSTICK)));
        while pending != 0 {
            let exception = pending.trailing_zeros() as usize + 16;
            let priority = self.priority(exception);
            if best.is_none_or(|(_, least)| priority < least) {
                best = Some((exception, priority));
            }
            pending &= pending - 1;
        }
        let (exception, priority) = best.filter(|(_, priority)| *priority < present)?;
        let Masks {
            primask,
            basepri,
            faultmask,
        } = masks();
        let limit = match basepri & PRIORITY_MASK {
            0 => 256,
            limit => limit.into(),
        };
        (!primask && !faultmask && priority < limit).then_some(exception)
    }

    /// Enters an exception.
    pub fn enter(&mut self, exception: Exception) {
        match exception {
            NMI => self.nmi_pending = false,
            SYSTICK => self.systick_pending = false,
            _ => {}
        }
        if exception >= 16 {
            self.latched &= !(1 << (exception - 16));
        }
        self.active.push(exception);
    }

    /// Leaves the innermost exception.
    pub fn leave(&mut self) -> Option<Exception> {
        self.active.pop()
    }

    /// Returns whether the trace unit is on: without it, the cycle counter has no registers.
    fn has_trace(&self) -> bool {
        self.trace & TRACE_ON != 0
    }

    fn cycle_count(&self, cycles: u64) -> u32 {
        if self.has_trace() && self.cycle_counter_enabled {
            self.count.wrapping_add((cycles - self.counted_from) as u32)
        } else {
            self.count
        }
    }

    /// Handles a load of a word.
    pub fn read(&self, address: u32, cycles: u64) -> u32 {
        let word = |bits: u128, first: u32| (bits >> ((address - first) * 8)) as u32;
        match address {
            0xe000_1000 if self.has_trace() => u32::from(self.cycle_counter_enabled) | 0x4000_0000,
            0xe000_1004 if self.has_trace() => self.cycle_count(cycles),
            0xe000_1000 | 0xe000_1004 | 0xe000_1fb4 | 0xe000_1fb0 => 0,
            0xe000_e100..0xe000_e110 => word(self.enabled, 0xe000_e100),
            0xe000_e180..0xe000_e190 => word(self.enabled, 0xe000_e180),
            0xe000_e200..0xe000_e210 => word(self.pending(), 0xe000_e200),
            0xe000_e280..0xe000_e290 => word(self.pending(), 0xe000_e280),
            0xe000_e400..0xe000_e460 => {
                let first = (address - 0xe000_e400) as usize & !3;
                u32::from_le_bytes(
                    self.priorities[first..first + 4]
                        .try_into()
                        .unwrap_or([0; 4]),
                )
            }
            // Cortex-M4 r0p1.
            0xe000_ed00 => 0x410f_c241,
            0xe000_ed04 => self.active.last().copied().unwrap_or(0) as u32,
            0xe000_ed08 => self.vector_table,
            0xe000_ed0c => 0xfa05_0000,
            0xe000_ed10 => self.system_control,
            0xe000_ed14 => 0x200,
            0xe000_ed18..=0xe000_ed23 => {
                let first = (address - 0xe000_ed18) as usize & !3;
                let bytes = &self.system_priorities[first + 4..first + 8];
                u32::from_le_bytes(bytes.try_into().unwrap_or([0; 4]))
            }
            0xe000_ed28 => self.fault_status,
            0xe000_ed24..=0xe000_ed3f => 0,
            0xe000_ed88 => self.coprocessor_access,
            0xe000_ed90..=0xe000_eda3 => self.protection.read(address),
            0xe000_edf0 => 0,
            0xe000_edfc => self.trace,
            0xe000_ef34 => self.floating_point_context,
            _ => panic!("load from {address:#010x}, which is not modelled"),
        }
    }

    /// Handles a store of a word, or of a byte for priorities.
    pub fn write(&mut self, address: u32, size: u32, value: u32, cycles: u64) {
        let bits = |first: u32| u128::from(value) << ((address - first) * 8);
        if matches!(address, 0xe000_1000 | 0xe000_1004 | 0xe000_edfc) {
            self.count = self.cycle_count(cycles);
            self.counted_from = cycles;
        }
        match address {
            0xe000_1000 if self.has_trace() => self.cycle_counter_enabled = value & 1 != 0,
            0xe000_1004 if self.has_trace() => self.count = value,
            0xe000_1000 | 0xe000_1004 => {}
            // The lock of the trace unit, which this processor lacks.
            0xe000_1fb0 => {}
            0xe000_e100..0xe000_e110 => self.enabled |= bits(0xe000_e100),
            0xe000_e180..0xe000_e190 => self.enabled &= !bits(0xe000_e180),
            0xe000_e200..0xe000_e210 => self.latched |= bits(0xe000_e200),
            0xe000_e280..0xe000_e290 => self.latched &= !bits(0xe000_e280),
            0xe000_e400..0xe000_e460 => {
                let first = (address - 0xe000_e400) as usize;
                for (place, byte) in value.to_le_bytes()[..size as usize].iter().enumerate() {
                    self.priorities[first + place] = *byte & PRIORITY_MASK;
                }
            }
            0xe000_ed08 => self.vector_table = value,
            0xe000_ed0c => self.reset_requested |= value >> 16 == 0x05fa && value & 4 != 0,
            0xe000_ed10 => self.system_control = value,
            0xe000_ed18..=0xe000_ed23 => {
                let first = (address - 0xe000_ed18) as usize + 4;
                for (place, byte) in value.to_le_bytes()[..size as usize].iter().enumerate() {
                    self.system_priorities[first + place] = *byte & PRIORITY_MASK;
                }
            }
            0xe000_ed24 => {}
            0xe000_ed28..=0xe000_ed3f => {}
            0xe000_ed88 => self.coprocessor_access = value,
            0xe000_ed90..=0xe000_eda3 => self.protection.write(address, value),
            0xe000_edfc => self.trace = value,
            0xe000_ef00 => self.latched |= 1 << (value & 0x7f),
            0xe000_ef34 => self.floating_point_context = value,
            _ => panic!("store of {value:#x} to {address:#010x}, which is not modelled"),
        }
    }
}

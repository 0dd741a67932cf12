//! Reset and clock control (RM0090, section 7).

use crate::machine::Reset;
use crate::stm32::SystemClock;
use crate::{MICROSECOND, MILLISECOND, Picoseconds};

const HSE_ON: u32 = 1 << 16;
const HSE_READY: u32 = 1 << 17;
const SECURITY_ON: u32 = 1 << 19;
const PLL_ON: u32 = 1 << 24;
const PLL_READY: u32 = 1 << 25;

/// Frequency of the internal oscillator, Hz.
const INTERNAL_HZ: u64 = 16_000_000;

/// Frequency of the crystal, Hz.
const CRYSTAL_HZ: u64 = 8_000_000;

/// Usual start-up time of the crystal.
const CRYSTAL_START: Picoseconds = 2 * MILLISECOND;

/// Longest time until the phase-locked loop has settled.
const LOCK: Picoseconds = 300 * MICROSECOND;

/// Registers of the clock control.
#[derive(Clone, Debug)]
pub struct Rcc {
    control: u32,
    pll: u32,
    configuration: u32,
    clock: SystemClock,
    interrupts: u32,
    registers: [u32; 32],
    flags: u32,
    hse_ready_at: Picoseconds,
    pll_ready_at: Picoseconds,
    /// Frequency of the crystal, Hz.
    crystal_hz: u64,
    /// Start-up time of the crystal.
    pub crystal_start: Picoseconds,
    /// Whether the crystal oscillates when switched on.
    pub crystal_works: bool,
    /// Set when the clock security system has detected a stopped crystal.
    pub nmi: bool,
}

impl Rcc {
    /// Creates the registers in their state after the first reset.
    pub fn new() -> Self {
        let mut registers = [0; 32];
        // The clock of the core-coupled memory is on, and in sleep all that may be.
        let on = [
            (0x30, 0x0010_0000),
            (0x50, 0x7e67_91ff),
            (0x54, 0xf1),
            (0x58, 0x1),
            (0x60, 0x36fe_c9ff),
            (0x64, 0x0007_5f33),
        ];
        for (offset, value) in on {
            registers[offset / 4] = value;
        }
        Self {
            control: 0x83,
            pll: 0x2400_3010,
            configuration: 0,
            clock: SystemClock::new(0),
            interrupts: 0,
            registers,
            flags: 0,
            hse_ready_at: Picoseconds::MAX,
            pll_ready_at: Picoseconds::MAX,
            crystal_hz: CRYSTAL_HZ,
            crystal_start: CRYSTAL_START,
            crystal_works: true,
            nmi: false,
        }
    }

    /// Resets the registers; the reset causes accumulate until they are cleared.
    pub fn reset(&mut self, reset: Reset) {
        let reason = match reset {
            Reset::Power => 0x0e00_0000,
            Reset::BrownOut => 0x0600_0000,
            Reset::Watchdog => 0x2400_0000,
            Reset::WindowWatchdog => 0x4400_0000,
            Reset::Software => 0x1400_0000,
            Reset::Pin => 0x0400_0000,
        };
        *self = Self {
            crystal_start: self.crystal_start,
            crystal_works: self.crystal_works,
            crystal_hz: self.crystal_hz,
            flags: self.flags | reason,
            ..Self::new()
        };
    }

    /// Returns whether a peripheral's clock is on, given the offset of its enable register and the
    /// bit.
    pub fn is_on(&self, register: u32, bit: u32) -> bool {
        self.registers[(register / 4) as usize] & 1 << bit != 0
    }

    fn crystal_is_ready(&self, now: Picoseconds) -> bool {
        self.crystal_works && self.control & HSE_ON != 0 && now >= self.hse_ready_at
    }

    /// The loop needs its source before it is switched on, and as long as it runs.
    fn pll_is_ready(&self, now: Picoseconds) -> bool {
        self.control & PLL_ON != 0 && now >= self.pll_ready_at && self.pll_has_source(now)
    }

    fn pll_has_source(&self, now: Picoseconds) -> bool {
        self.pll & 1 << 22 == 0 || self.crystal_is_ready(now)
    }

    /// Handles a load.
    pub fn read(&self, offset: u32, now: Picoseconds) -> u32 {
        match offset {
            0x00 => {
                let ready = if self.crystal_is_ready(now) {
                    HSE_READY
                } else {
                    0
                };
                let locked = if self.pll_is_ready(now) { PLL_READY } else { 0 };
                self.control & !(HSE_READY | PLL_READY) | ready | locked
            }
            0x04 => self.pll,
            0x08 => self.configuration & !0xc | self.clock.source() << 2,
            0x0c => self.interrupts | u32::from(self.nmi) << 7,
            0x74 => self.flags | self.registers[0x1d] & 1 | (self.registers[0x1d] & 1) << 1,
            0x10..0x80 => self.registers[(offset / 4) as usize],
            // The loop of I2S, which is not modelled.
            0x84 => 0x2000_3000,
            _ => 0,
        }
    }

    /// Handles a store.
    pub fn write(&mut self, offset: u32, value: u32, now: Picoseconds) {
        match offset {
            0x00 => {
                if value & !self.control & HSE_ON != 0 {
                    self.hse_ready_at = now + self.crystal_start;
                }
                if value & !self.control & PLL_ON != 0 {
                    let has_source = self.pll_has_source(now);
                    self.pll_ready_at = if has_source {
                        now + LOCK
                    } else {
                        Picoseconds::MAX
                    };
                }
                self.control = value;
            }
            0x04 => {
                assert_eq!(self.control & PLL_ON, 0, "the phase-locked loop is on");
                self.pll = value;
            }
            0x08 => {
                let is_ready = match value & 3 {
                    0 => true,
                    1 => self.crystal_is_ready(now),
                    _ => self.pll_is_ready(now),
                };
                let is_switch = (self.configuration ^ value) & 3 != 0;
                assert!(is_ready || !is_switch, "the clock is not ready");
                if is_switch {
                    self.clock.switch(now);
                }
                self.configuration = value;
            }
            0x0c => {
                self.interrupts = value & 0x7f00;
                if value & 1 << 23 != 0 {
                    self.nmi = false;
                }
            }
            0x74 => {
                if value & 1 << 24 != 0 {
                    self.flags = 0;
                }
                self.registers[0x1d] = value & 1;
            }
            0x10..0x80 => self.registers[(offset / 4) as usize] = value,
            _ => {}
        }
    }

    /// Returns the time of the next event.
    pub fn next_event(&self) -> Picoseconds {
        self.clock.next_event()
    }

    /// Performs due events; returns whether the system clock has changed.
    pub fn advance(&mut self, now: Picoseconds) -> bool {
        self.clock.advance(self.configuration & 3, now)
    }

    /// Stops the crystal; with the clock security system on, the processor continues on the
    /// internal oscillator.
    pub fn stop_crystal(&mut self) {
        self.crystal_works = false;
        if self.control & SECURITY_ON != 0 && self.control & HSE_ON != 0 {
            self.nmi = true;
            self.configuration &= !3;
            self.clock = SystemClock::new(0);
            self.control &= !(HSE_ON | PLL_ON);
        }
    }

    /// Changes the crystal's frequency by this many parts per million.
    pub fn detune(&mut self, ppm: i32) {
        let change = CRYSTAL_HZ as i64 * i64::from(ppm) / 1_000_000;
        self.crystal_hz = CRYSTAL_HZ.saturating_add_signed(change);
    }

    fn pll_hz(&self) -> u64 {
        let from_crystal = self.pll & 1 << 22 != 0;
        let input = match (from_crystal, self.crystal_works) {
            (false, _) => INTERNAL_HZ,
            (true, true) => self.crystal_hz,
            (true, false) => 0,
        };
        let divisor = u64::from(self.pll & 0x3f).max(1);
        let multiplier = u64::from(self.pll >> 6 & 0x1ff);
        let output = 2 * (u64::from(self.pll >> 16 & 3) + 1);
        input * multiplier / divisor / output
    }

    /// Returns the system clock before its dividers, Hz; 0 if it has stopped.
    fn system_hz(&self) -> u64 {
        match self.clock.source() {
            0 => INTERNAL_HZ,
            1 if self.crystal_works => self.crystal_hz,
            1 => 0,
            _ => self.pll_hz(),
        }
    }

    /// Returns the processor's clock, Hz.
    pub fn core_hz(&self) -> u64 {
        let divisor = match self.configuration >> 4 & 15 {
            small @ 0..8 => u64::from(small / 8 + 1),
            large @ 8..12 => 2 << (large - 8),
            large => 64 << (large - 12),
        };
        self.system_hz() / divisor
    }

    fn bus_divisor(bits: u32) -> u64 {
        if bits & 4 == 0 { 1 } else { 2 << (bits & 3) }
    }

    /// Returns the clock of the slow peripherals' bus, Hz.
    pub fn slow_bus_hz(&self) -> u64 {
        self.core_hz() / Self::bus_divisor(self.configuration >> 10 & 7)
    }

    /// Returns the clock of the fast peripherals' bus, Hz.
    pub fn fast_bus_hz(&self) -> u64 {
        self.core_hz() / Self::bus_divisor(self.configuration >> 13 & 7)
    }

    /// Returns the clock of the timers on the slow bus, Hz.
    pub fn slow_timer_hz(&self) -> u64 {
        let divisor = Self::bus_divisor(self.configuration >> 10 & 7);
        self.slow_bus_hz() * if divisor == 1 { 1 } else { 2 }
    }
}

impl Default for Rcc {
    fn default() -> Self {
        Self::new()
    }
}

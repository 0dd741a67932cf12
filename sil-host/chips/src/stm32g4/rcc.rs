//! Reset and clock control (RM0440, chapter RCC).

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
const CRYSTAL_HZ: u64 = 24_000_000;

/// Usual start-up time of the crystal.
const CRYSTAL_START: Picoseconds = 2 * MILLISECOND;

/// Offsets of the registers that switch peripherals' clocks on.
pub mod bus {
    /// AHB1.
    pub const AHB1: u32 = 0x48;
    /// AHB2.
    pub const AHB2: u32 = 0x4c;
    /// APB1.
    pub const APB1: u32 = 0x58;
    /// APB2.
    pub const APB2: u32 = 0x60;
}

/// Highest clock to which the system clock is switched without a divider (chapter PWR, "Dynamic voltage scaling
/// management"), Hz.
const UNDIVIDED_HZ: u64 = 80_000_000;

/// Longest time until the phase-locked loop has settled.
const LOCK: Picoseconds = 40 * MICROSECOND;

/// Registers of the clock control.
#[derive(Clone, Debug)]
pub struct Rcc {
    control: u32,
    pll: u32,
    configuration: u32,
    clock: SystemClock,
    registers: [u32; 40],
    flags: u32,
    hse_ready_at: Picoseconds,
    pll_ready_at: Picoseconds,
    /// Time of the last switch of the system clock.
    switched_at: Picoseconds,
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
        let mut registers = [0; 40];
        // The clocks of the flash and of the interface to the real-time clock are on, and in sleep all that may be.
        let on = [
            (bus::AHB1, 0x100),
            (bus::APB1, 0x400),
            (0x68, 0x130f),
            (0x6c, 0x050f_667f),
            (0x70, 0x101),
            (0x78, 0xd2fe_cd3f),
            (0x7c, 0x103),
            (0x80, 0x0437_f801),
        ];
        for (offset, value) in on {
            registers[offset as usize / 4] = value;
        }
        Self {
            control: 0x63,
            pll: 0x1000,
            configuration: 0x5,
            clock: SystemClock::new(1),
            registers,
            flags: 0,
            hse_ready_at: Picoseconds::MAX,
            pll_ready_at: Picoseconds::MAX,
            switched_at: 0,
            crystal_hz: CRYSTAL_HZ,
            crystal_start: CRYSTAL_START,
            crystal_works: true,
            nmi: false,
        }
    }

    /// Resets the registers; the reset causes accumulate until they are cleared.
    pub fn reset(&mut self, reset: Reset) {
        let reason = match reset {
            Reset::Power | Reset::BrownOut => 0x0c00_0000,
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

    /// Returns whether a peripheral's clock is on, given the offset of its enable register and the bit.
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
        match self.pll & 3 {
            2 => true,
            3 => self.crystal_is_ready(now),
            _ => false,
        }
    }

    /// Handles a load.
    pub fn read(&self, offset: u32, now: Picoseconds) -> u32 {
        match offset {
            0x00 => {
                let flag = |is_set: bool, bit: u32| if is_set { bit } else { 0 };
                self.control & !(HSE_READY | PLL_READY)
                    | flag(self.crystal_is_ready(now), HSE_READY)
                    | flag(self.pll_is_ready(now), PLL_READY)
            }
            // The trimming of the internal oscillator.
            0x04 => 0x4000_0000,
            0x08 => self.configuration & !0xc | self.clock.source() << 2,
            0x0c => self.pll,
            0x1c => u32::from(self.nmi) << 8,
            0x94 => self.flags,
            0x28..0xa0 => self.registers[(offset / 4) as usize],
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
            0x08 => self.configure(value, now),
            0x0c => {
                assert_eq!(self.control & PLL_ON, 0, "the phase-locked loop is on");
                self.pll = value;
            }
            0x20 if value & 1 << 8 != 0 => self.nmi = false,
            0x94 if value & 1 << 23 != 0 => self.flags = 0,
            0x28..0x94 => self.registers[(offset / 4) as usize] = value,
            _ => {}
        }
    }

    /// Stores the configuration.
    fn configure(&mut self, value: u32, now: Picoseconds) {
        let is_switch = (self.configuration ^ value) & 3 != 0;
        self.configuration = value;
        let is_ready = match value & 3 {
            1 => true,
            2 => self.crystal_is_ready(now),
            _ => self.pll_is_ready(now),
        };
        assert!(is_ready || !is_switch, "the clock is not ready");
        if is_switch {
            self.clock.switch(now);
        }
        self.check_divider(now);
    }

    /// The bus clock is divided before the system clock rises, and for a microsecond after that.
    fn check_divider(&self, now: Picoseconds) {
        assert!(
            self.system_hz() <= UNDIVIDED_HZ
                || self.is_divided()
                || now >= self.switched_at + MICROSECOND,
            "the divider comes too late or goes too early"
        );
    }

    /// Returns the time of the next event.
    pub fn next_event(&self) -> Picoseconds {
        self.clock.next_event()
    }

    /// Performs due events; returns whether the system clock has changed.
    pub fn advance(&mut self, now: Picoseconds) -> bool {
        let has_switched = self.clock.advance(self.configuration & 3, now);
        if has_switched {
            self.switched_at = now;
            self.check_divider(now);
        }
        has_switched
    }

    /// Returns whether the processor's clock is that of the system divided by two or more.
    pub fn is_divided(&self) -> bool {
        self.configuration & 0x80 != 0
    }

    /// Stops the crystal; with the clock security system on, the processor continues on the internal
    /// oscillator.
    pub fn stop_crystal(&mut self) {
        self.crystal_works = false;
        if self.control & SECURITY_ON != 0 && self.control & HSE_ON != 0 {
            self.nmi = true;
            self.configuration = self.configuration & !3 | 1;
            self.clock = SystemClock::new(1);
            self.control &= !(HSE_ON | PLL_ON);
        }
    }

    /// Changes the crystal's frequency by this many parts per million.
    pub fn detune(&mut self, ppm: i32) {
        let change = CRYSTAL_HZ as i64 * i64::from(ppm) / 1_000_000;
        self.crystal_hz = CRYSTAL_HZ.saturating_add_signed(change);
    }

    fn pll_hz(&self) -> u64 {
        const OUTPUT_ON: u32 = 1 << 24;
        let input = match (self.pll & 3, self.crystal_works) {
            (2, _) => INTERNAL_HZ,
            (3, true) => self.crystal_hz,
            _ => 0,
        };
        if self.pll & OUTPUT_ON == 0 {
            return 0;
        }
        let divisor = u64::from(self.pll >> 4 & 15) + 1;
        let multiplier = u64::from(self.pll >> 8 & 0x7f);
        let output = 2 * (u64::from(self.pll >> 25 & 3) + 1);
        input * multiplier / divisor / output
    }

    /// Returns the system clock before its divider, Hz; 0 if it has stopped.
    pub fn system_hz(&self) -> u64 {
        match self.clock.source() {
            1 => INTERNAL_HZ,
            2 if self.crystal_works => self.crystal_hz,
            3 => self.pll_hz(),
            _ => 0,
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

    /// Returns the clock of the peripherals' buses and timers, Hz.
    ///
    /// # Panics
    /// If the image divides it: this is not modelled.
    pub fn bus_hz(&self) -> u64 {
        assert_eq!(self.configuration >> 8 & 0x3f, 0, "divided buses");
        self.core_hz()
    }
}

impl Default for Rcc {
    fn default() -> Self {
        Self::new()
    }
}

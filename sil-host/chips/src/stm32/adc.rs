//! An analog-to-digital converter with one conversion at a time (RM0090, section 13; RM0440, chapter ADC). The steps of
//! its start are those of the manuals, in their order.

use super::is_within;
use crate::{MICROSECOND, Picoseconds, SECOND};

/// Where a family's converter has its registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AdcLayout {
    /// One control register with a bit that starts a conversion; no calibration.
    Plain,
    /// Deep power-down, a regulator and a calibration.
    Regulated,
}

/// Time until the plain converter, and the regulator of the other one, have settled, and of a calibration.
const START: Picoseconds = 3 * MICROSECOND;
const REGULATOR: Picoseconds = 20 * MICROSECOND;
const CALIBRATION: Picoseconds = 4 * MICROSECOND;

const DEEP_POWER_DOWN: u32 = 1 << 29;
const REGULATOR_ON: u32 = 1 << 28;
const CALIBRATE: u32 = 1 << 31;
const CONVERTED: u32 = 1 << 2;
const READY: u32 = 1;

impl AdcLayout {
    /// Returns the highest clock, Hz.
    fn fastest_hz(self) -> u64 {
        match self {
            Self::Plain => 36_000_000,
            Self::Regulated => 60_000_000,
        }
    }

    /// Returns the cycles of the longest conversion.
    fn cycles(self) -> u64 {
        match self {
            Self::Plain => 480 + 12,
            Self::Regulated => 641 + 12,
        }
    }
}

/// Registers of a converter.
#[derive(Clone, Debug)]
pub struct Adc {
    layout: AdcLayout,
    control: u32,
    /// Sample times, the sequence and the common clock, by offset.
    registers: [u32; 256],
    settled_at: Picoseconds,
    calibrated_at: Picoseconds,
    result: u32,
    ends: Option<Picoseconds>,
}

impl Adc {
    /// Creates a converter in its reset state.
    pub fn new(layout: AdcLayout) -> Self {
        let mut registers = [0; 256];
        // The watchdogs' thresholds and, of both converters of a block, control and configuration.
        let after_reset: &[(usize, u32)] = match layout {
            AdcLayout::Plain => &[(0x24, 0xfff)],
            AdcLayout::Regulated => &[
                (0x08, DEEP_POWER_DOWN),
                (0x0c, 0x8000_0000),
                (0x20, 0x0fff_0000),
                (0x24, 0x00ff_0000),
                (0x28, 0x00ff_0000),
                (0x10c, 0x8000_0000),
                (0x120, 0x0fff_0000),
                (0x124, 0x00ff_0000),
                (0x128, 0x00ff_0000),
            ],
        };
        for (offset, value) in after_reset {
            registers[offset / 4] = *value;
        }
        Self {
            layout,
            control: match layout {
                AdcLayout::Plain => 0,
                AdcLayout::Regulated => DEEP_POWER_DOWN,
            },
            registers,
            settled_at: 0,
            calibrated_at: Picoseconds::MAX,
            result: 0,
            ends: None,
        }
    }

    /// Handles a load; offsets count from the first converter of the block.
    pub fn read(&mut self, offset: u32, now: Picoseconds) -> u32 {
        let has_ended = self.ends.is_some_and(|it| it <= now);
        match (self.layout, offset) {
            (AdcLayout::Plain, 0x00) => u32::from(has_ended) << 1,
            (AdcLayout::Plain, 0x08) => self.control,
            (AdcLayout::Regulated, 0x108) => {
                let calibrates = now < self.calibrated_at && self.calibrated_at < Picoseconds::MAX;
                self.control | (u32::from(calibrates) * CALIBRATE)
            }
            (AdcLayout::Regulated, 0x100) => {
                (u32::from(has_ended) * CONVERTED) | (u32::from(self.is_ready(now)) * READY)
            }
            (AdcLayout::Plain, 0x4c) | (AdcLayout::Regulated, 0x140) => {
                if has_ended {
                    self.ends = None;
                }
                self.result
            }
            _ => self.registers[(offset / 4) as usize & 255],
        }
    }

    fn is_ready(&self, now: Picoseconds) -> bool {
        self.control & 1 != 0 && now >= self.settled_at
    }

    /// Returns the converter's clock, made from that of its bus.
    fn clock_hz(&self, bus_hz: u64) -> u64 {
        let field = |register: usize| self.registers[register / 4] >> 16 & 3;
        let divisor = match self.layout {
            AdcLayout::Plain => 2 * (field(0x304) + 1),
            AdcLayout::Regulated => [0, 1, 2, 4][field(0x308) as usize],
        };
        let hz = bus_hz.checked_div(divisor.into()).unwrap_or_default();
        assert!(
            hz > 0 && is_within(hz, self.layout.fastest_hz()),
            "clock of {hz} Hz"
        );
        hz
    }

    /// Handles a store, while the bus's clock runs at `bus_hz`. `sample` gives the code of a channel.
    ///
    /// # Panics
    /// If the converter is used in another way than the manual says.
    pub fn write(
        &mut self,
        (offset, value): (u32, u32),
        bus_hz: u64,
        now: Picoseconds,
        sample: impl FnOnce(u32) -> u32,
    ) {
        match (self.layout, offset) {
            (AdcLayout::Plain, 0x08) => {
                if value & !self.control & 1 != 0 {
                    self.settled_at = now + START;
                }
                self.control = value & !(1 << 30);
                if value & 1 << 30 != 0 {
                    let channel = self.registers[0x34 / 4] & 31;
                    self.convert(channel, bus_hz, now, sample);
                }
            }
            (AdcLayout::Regulated, 0x108) => self.control_regulated(value, bus_hz, now, sample),
            _ => self.registers[(offset / 4) as usize & 255] = value,
        }
    }

    fn control_regulated(
        &mut self,
        value: u32,
        bus_hz: u64,
        now: Picoseconds,
        sample: impl FnOnce(u32) -> u32,
    ) {
        if value & !self.control & REGULATOR_ON != 0 {
            assert_eq!(self.control & DEEP_POWER_DOWN, 0, "deep power-down");
            self.settled_at = now + REGULATOR;
        }
        if value & CALIBRATE != 0 {
            assert!(
                now >= self.settled_at && self.control & 1 == 0,
                "calibration"
            );
            self.calibrated_at = now + CALIBRATION;
        }
        if value & !self.control & 1 != 0 {
            assert!(now >= self.calibrated_at, "start");
            // One conversion.
            self.settled_at = now + self.conversion(bus_hz);
        }
        // A bit that a program can only set stays.
        self.control = value & !(CALIBRATE | 4) | self.control & 1;
        if value & 4 != 0 {
            let channel = self.registers[0x130 / 4] >> 6 & 31;
            self.convert(channel, bus_hz, now, sample);
        }
    }

    /// Returns the duration of the longest conversion.
    fn conversion(&self, bus_hz: u64) -> Picoseconds {
        SECOND * self.layout.cycles() / self.clock_hz(bus_hz)
    }

    fn convert(
        &mut self,
        channel: u32,
        bus_hz: u64,
        now: Picoseconds,
        sample: impl FnOnce(u32) -> u32,
    ) {
        assert!(self.is_ready(now), "a conversion before the start");
        self.result = sample(channel);
        self.ends = Some(now + self.conversion(bus_hz));
    }
}

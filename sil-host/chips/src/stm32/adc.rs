//! An analog-to-digital converter with one conversion at a time (RM0090, section 13; RM0440, chapter ADC). The steps of
//! its start are those of the manuals, in their order.

use crate::{MICROSECOND, Picoseconds};

/// Where a family's converter has its registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AdcLayout {
    /// One control register with a bit that starts a conversion; no calibration.
    Plain,
    /// Deep power-down, a regulator and a calibration.
    Regulated,
}

/// Time until the regulator has settled, and of a calibration.
const REGULATOR: Picoseconds = 20 * MICROSECOND;
const CALIBRATION: Picoseconds = 4 * MICROSECOND;

const DEEP_POWER_DOWN: u32 = 1 << 29;
const REGULATOR_ON: u32 = 1 << 28;
const CALIBRATE: u32 = 1 << 31;
const CONVERTED: u32 = 1 << 2;

/// Registers of a converter.
#[derive(Clone, Debug)]
pub struct Adc {
    layout: AdcLayout,
    control: u32,
    /// Sample times, the sequence and the common clock, by offset.
    registers: [u32; 256],
    settled_at: Picoseconds,
    is_calibrated: bool,
    result: u32,
    ends: Option<Picoseconds>,
}

impl Adc {
    /// Creates a converter in its reset state.
    pub fn new(layout: AdcLayout) -> Self {
        Self {
            layout,
            control: match layout {
                AdcLayout::Plain => 0,
                AdcLayout::Regulated => DEEP_POWER_DOWN,
            },
            registers: [0; 256],
            settled_at: 0,
            is_calibrated: false,
            result: 0,
            ends: None,
        }
    }

    /// Handles a load; offsets count from the first converter of the block.
    pub fn read(&mut self, offset: u32, now: Picoseconds) -> u32 {
        let has_ended = self.ends.is_some_and(|it| it <= now);
        match (self.layout, offset) {
            (AdcLayout::Plain, 0x00) => u32::from(has_ended) << 1,
            (AdcLayout::Plain, 0x08) | (AdcLayout::Regulated, 0x108) => self.control,
            (AdcLayout::Regulated, 0x100) => {
                (u32::from(has_ended) * CONVERTED) | (self.control & 1)
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

    /// Handles a store. `sample` gives the code of a channel.
    ///
    /// # Panics
    /// If the converter is used in another way than the manual says.
    pub fn write(
        &mut self,
        (offset, value): (u32, u32),
        now: Picoseconds,
        sample: impl FnOnce(u32) -> u32,
    ) {
        match (self.layout, offset) {
            (AdcLayout::Plain, 0x08) => {
                let starts = value & 1 << 30 != 0;
                assert!(
                    !starts || self.control & 1 != 0,
                    "a conversion without power"
                );
                self.control = value & !(1 << 30);
                if starts {
                    // Clock divided by four, so that it is not too fast.
                    assert_eq!(self.registers[0x304 / 4] >> 16 & 3, 1, "clock");
                    self.convert(self.registers[0x34 / 4] & 31, now, sample);
                }
            }
            (AdcLayout::Regulated, 0x108) => self.control_regulated(value, now, sample),
            _ => self.registers[(offset / 4) as usize & 255] = value,
        }
    }

    fn control_regulated(&mut self, value: u32, now: Picoseconds, sample: impl FnOnce(u32) -> u32) {
        if value & !self.control & REGULATOR_ON != 0 {
            assert_eq!(self.control & DEEP_POWER_DOWN, 0, "deep power-down");
            self.settled_at = now + REGULATOR;
        }
        if value & CALIBRATE != 0 {
            assert!(
                now >= self.settled_at && self.control & 1 == 0,
                "calibration"
            );
            self.settled_at = now + CALIBRATION;
            self.is_calibrated = true;
        }
        if value & !self.control & 1 != 0 {
            assert!(now >= self.settled_at && self.is_calibrated, "start");
        }
        // A bit that a program can only set stays.
        self.control = value & !(CALIBRATE | 4) | self.control & 1;
        if value & 4 != 0 {
            assert!(self.control & 1 != 0, "a conversion without power");
            assert_ne!(self.registers[0x308 / 4] >> 16 & 3, 0, "clock");
            self.convert(self.registers[0x130 / 4] >> 6 & 31, now, sample);
        }
    }

    fn convert(&mut self, channel: u32, now: Picoseconds, sample: impl FnOnce(u32) -> u32) {
        self.result = sample(channel);
        self.ends = Some(now + 24 * MICROSECOND);
    }
}

//! A digital-to-analog converter of two channels (RM0090, section 14; RM0440, chapter DAC).

/// Registers of a converter.
#[derive(Clone, Debug, Default)]
pub struct Dac {
    /// Enables the channels, bits 0 and 16.
    pub control: u32,
    /// Modes of the output buffers, on families that have them.
    pub modes: u32,
    /// Codes of the channels.
    pub codes: [u32; 2],
    /// Number of stores of codes.
    pub writes: u64,
}

impl Dac {
    /// Resets the registers.
    pub fn reset(&mut self) {
        *self = Self {
            writes: self.writes,
            ..Self::default()
        };
    }

    /// Returns the codes at the outputs: 0 for a channel that is off.
    pub fn outputs(&self) -> [u32; 2] {
        let [one, two] = self.codes;
        [one * (self.control & 1), two * (self.control >> 16 & 1)]
    }

    /// Handles a load.
    pub fn read(&self, offset: u32) -> u32 {
        match offset {
            0x00 => self.control,
            0x08 | 0x2c => self.codes[0],
            0x14 | 0x30 => self.codes[1],
            0x20 => self.codes[0] | self.codes[1] << 16,
            0x3c => self.modes,
            // Times of sample and hold, which is not modelled.
            0x48 | 0x4c => 0x0001_0001,
            _ => 0,
        }
    }

    /// Handles a store.
    pub fn write(&mut self, offset: u32, value: u32) {
        match offset {
            0x00 => self.control = value,
            0x3c => self.modes = value,
            _ => self.writes += 1,
        }
        match offset {
            0x08 => self.codes[0] = value & 0xfff,
            0x14 => self.codes[1] = value & 0xfff,
            0x20 => self.codes = [value & 0xfff, value >> 16 & 0xfff],
            _ => {}
        }
    }
}

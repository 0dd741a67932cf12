//! One GPIO port (RM0090, section 8; RM0440, chapter GPIO).

use super::PinMode;

/// Registers of a port.
#[derive(Clone, Debug)]
pub struct Gpio {
    mode: u32,
    output_type: u32,
    speed: u32,
    pull: u32,
    output: u32,
    alternate: [u32; 2],
    /// Levels at which external parts drive the pins.
    pub external: [Option<bool>; 16],
}

/// Registers of a port after a reset that are not zero: mode, speed, pull.
pub type GpioReset = (u32, u32, u32);

impl Gpio {
    /// Creates the port in its reset state.
    pub fn new((mode, speed, pull): GpioReset) -> Self {
        Self {
            mode,
            output_type: 0,
            speed,
            pull,
            output: 0,
            alternate: [0; 2],
            external: [None; 16],
        }
    }

    /// Resets the registers; what drives the pins from outside stays.
    pub fn reset(&mut self, state: GpioReset) {
        let external = self.external;
        *self = Self::new(state);
        self.external = external;
    }

    /// Returns the mode of a pin.
    pub fn pin(&self, pin: usize) -> PinMode {
        match self.mode >> (2 * pin) & 3 {
            0 => PinMode::Input,
            1 => PinMode::Output(self.output & 1 << pin != 0),
            2 => PinMode::Alternate((self.alternate[pin / 8] >> (4 * (pin % 8)) & 15) as u8),
            _ => PinMode::Analog,
        }
    }

    /// Returns the speed of a pin's driver, from 0 for low to 3 for very high.
    pub fn speed(&self, pin: usize) -> u32 {
        self.speed >> (2 * pin) & 3
    }

    /// Handles a load.
    pub fn read(&self, offset: u32) -> u32 {
        match offset {
            0x00 => self.mode,
            0x04 => self.output_type,
            0x08 => self.speed,
            0x0c => self.pull,
            0x10 => self.input(),
            0x14 => self.output,
            0x20 => self.alternate[0],
            0x24 => self.alternate[1],
            _ => 0,
        }
    }

    /// Handles a store.
    pub fn write(&mut self, offset: u32, value: u32) {
        match offset {
            0x00 => self.mode = value,
            0x04 => self.output_type = value,
            0x08 => self.speed = value,
            0x0c => self.pull = value,
            0x14 => self.output = value & 0xffff,
            0x18 => self.output = (self.output & !(value >> 16)) | (value & 0xffff),
            0x20 => self.alternate[0] = value,
            0x24 => self.alternate[1] = value,
            _ => {}
        }
    }

    fn input(&self) -> u32 {
        let level = |pin: usize| match (self.pin(pin), self.external[pin]) {
            (PinMode::Output(level), _) => level,
            (PinMode::Analog, _) => false,
            (_, Some(level)) => level,
            // Not driven: its own pull resistor decides.
            (_, None) => self.pull >> (2 * pin) & 3 == 1,
        };
        (0..16).fold(0, |bits, pin| bits | u32::from(level(pin)) << pin)
    }
}

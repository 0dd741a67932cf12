//! Pins (RM0440, chapter GPIO). A pin is configured without disturbing the others of its port.

#![allow(unsafe_code)] // registers by port and number

use core::convert::Infallible;

use embedded_hal::digital::{ErrorType, OutputPin};

use crate::pac;

/// A port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Port {
    /// Port A.
    A,
    /// Port B.
    B,
    /// Port C.
    C,
}

impl Port {
    /// All ports have the same registers.
    fn registers(self) -> &'static pac::gpioc::RegisterBlock {
        let address = match self {
            Self::A => pac::GPIOA::ptr().cast(),
            Self::B => pac::GPIOB::ptr().cast(),
            Self::C => pac::GPIOC::ptr(),
        };
        // SAFETY: the address of a port, whose registers are cells. Pins are configured before interrupts are on, so
        // that nothing comes between a read and its store; later only `bsrr` is written, which changes one pin.
        unsafe { &*address }
    }
}

/// Pins of the three ports, whose clocks are on.
pub struct Pins(());

/// Modes of a pin.
const INPUT: u32 = 0;
const OUTPUT: u32 = 1;
const ALTERNATE: u32 = 2;
const ANALOG: u32 = 3;

impl Pins {
    /// Takes ownership of the ports and switches their clocks on. Pins keep their modes.
    pub fn new(_: pac::GPIOA, _: pac::GPIOB, _: pac::GPIOC, rcc: &pac::RCC) -> Self {
        rcc.ahb2enr().modify(|_, w| {
            w.gpioaen().set_bit();
            w.gpioben().set_bit().gpiocen().set_bit()
        });
        let _ = rcc.ahb2enr().read();
        Self(())
    }

    /// Makes a pin an output with this level, without a pulse of the other one.
    pub fn output(&mut self, port: Port, number: u8, is_high: bool) -> Output {
        let output = Output { port, number };
        output.set(is_high);
        set_mode(port, number, OUTPUT);
        output
    }

    /// Makes a pin an input with a pull-down resistor.
    pub fn pulled_down_input(&mut self, port: Port, number: u8) -> Input {
        const PULL_DOWN: u32 = 2;
        let pulls = port.registers().pupdr();
        // SAFETY: two bits of this pin.
        pulls.modify(|r, w| unsafe { w.bits(with_pair(r.bits(), number, PULL_DOWN)) });
        set_mode(port, number, INPUT);
        Input { port, number }
    }

    /// Connects a pin with a peripheral, by the number in the data sheet's table of alternate functions.
    pub fn alternate(&mut self, port: Port, number: u8, function: u32) {
        const HIGH_SPEED: u32 = 2;
        let registers = port.registers();
        let shift = 4 * (number % 8);
        let with_function = |bits: u32| bits & !(15 << shift) | function << shift;
        // SAFETY: four and two bits of this pin.
        unsafe {
            if number < 8 {
                let functions = registers.afrl();
                functions.modify(|r, w| w.bits(with_function(r.bits())));
            } else {
                let functions = registers.afrh();
                functions.modify(|r, w| w.bits(with_function(r.bits())));
            }
            let speeds = registers.ospeedr();
            speeds.modify(|r, w| w.bits(with_pair(r.bits(), number, HIGH_SPEED)));
        }
        set_mode(port, number, ALTERNATE);
    }

    /// Leaves a pin to an analogue peripheral.
    pub fn analog(&mut self, port: Port, number: u8) {
        set_mode(port, number, ANALOG);
    }
}

/// Returns a register with another value of a pin's two bits.
fn with_pair(bits: u32, number: u8, value: u32) -> u32 {
    let shift = 2 * number;
    bits & !(3 << shift) | value << shift
}

fn set_mode(port: Port, number: u8, mode: u32) {
    let modes = port.registers().moder();
    // SAFETY: two bits of this pin.
    modes.modify(|r, w| unsafe { w.bits(with_pair(r.bits(), number, mode)) });
}

/// An input.
pub struct Input {
    port: Port,
    number: u8,
}

impl Input {
    /// Returns whether the pin is high.
    pub fn is_high(&self) -> bool {
        self.port.registers().idr().read().bits() & 1 << self.number != 0
    }
}

/// A push-pull output.
pub struct Output {
    port: Port,
    number: u8,
}

impl Output {
    /// Sets the level.
    pub fn set(&self, is_high: bool) {
        let bit = if is_high {
            self.number
        } else {
            self.number + 16
        };
        let set = self.port.registers().bsrr();
        // SAFETY: sets or clears this pin only.
        set.write(|w| unsafe { w.bits(1 << bit) });
    }
}

impl ErrorType for Output {
    type Error = Infallible;
}

impl OutputPin for Output {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.set(false);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.set(true);
        Ok(())
    }
}

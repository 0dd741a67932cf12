//! What several families of microcontrollers have in common: pins, and peripherals with the same registers.

mod dac;
mod flash;
mod gpio;
mod timer;
mod usart;
mod watchdog;

pub use dac::Dac;
pub use flash::{FlashSlots, Power};
pub use gpio::{Gpio, GpioReset};
pub use timer::Timer;
pub use usart::{Usart, UsartLayout};
pub use watchdog::{Watchdog, WindowWatchdog};

use crate::Transfer;

use crate::Picoseconds;
use crate::machine::Chip;

/// A pin: port (0 for A) and number.
pub type Pin = (usize, usize);

/// Mode of a pin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PinMode {
    /// Drives nothing.
    Input,
    /// Driven high or low.
    Output(bool),
    /// Driven by the peripheral of this number.
    Alternate(u8),
    /// Not driven, or an analogue output.
    Analog,
}

/// The parts on the pins.
pub trait Outside: Clone {
    /// Called when the microcontroller starts or stops driving a pin.
    fn pin(&mut self, pin: Pin, level: Option<bool>, now: Picoseconds);

    /// Called at the end of a transfer on an SPI bus (0 for SPI1); returns the answer.
    fn transfer(&mut self, bus: usize, transfer: Transfer, now: Picoseconds) -> u16;
}

/// A failure of the crystal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Crystal {
    /// It never oscillates.
    Dead,
    /// It has oscillated and stops.
    Stops,
}

/// A chip with parts on its pins, as a board and its host see it.
pub trait WiredChip: Chip {
    /// The parts on the pins.
    type Outside: Outside;

    /// Lowest, usual and highest frequency of the independent watchdog's oscillator, Hz.
    const OSCILLATOR_HZ: [u64; 3];

    /// Creates the chip without power; `oscillator_hz` is that of the independent watchdog.
    fn without_power(outside: Self::Outside, oscillator_hz: u64) -> Self;

    /// Returns the parts on the pins.
    fn outside_mut(&mut self) -> &mut Self::Outside;

    /// Returns the mode of a pin.
    fn pin(&self, pin: Pin) -> PinMode;

    /// Drives a pin from outside, or releases it.
    fn drive_pin(&mut self, pin: Pin, level: Option<bool>);

    /// Returns the codes of the digital-to-analog converter.
    fn dac_codes(&self) -> [u32; 2];

    /// Returns whether an output buffer limits the converter's range.
    fn dac_is_buffered(&self) -> bool;

    /// Returns how often codes were written to the converter.
    fn dac_writes(&self) -> u64;

    /// Returns the flash that keeps configurations.
    fn slots_mut(&mut self) -> &mut FlashSlots;

    /// Gives the chip the option bytes of a new one, without a brown-out level.
    fn set_new_options(&mut self);

    /// Stops the crystal.
    fn set_crystal(&mut self, failure: Crystal);

    /// Changes the supply. The chip is reset below the brown-out threshold.
    fn set_supply(&mut self, millivolts: u32);

    /// Stops the control timer.
    fn stop_control_timer(&mut self);

    /// Pulls the reset pin low for a moment.
    fn reset_pin(&mut self);

    /// Sets the phases of the prescalers of both watchdogs, which run freely: any number.
    fn set_watchdog_phase(&mut self, phase: u64);

    /// Returns the serial port to the host.
    fn usart(&self) -> &Usart;

    /// Returns the serial port to the host, to send to it.
    fn usart_mut(&mut self) -> &mut Usart;

    /// Returns the time of the control timer's next interrupt.
    fn next_tick(&self) -> Picoseconds;
}

/// Performs a store to a port and reports the pins that it changes.
pub fn store_port(
    gpio: &mut Gpio,
    port: usize,
    (offset, value): (u32, u32),
    outside: &mut impl Outside,
    now: Picoseconds,
) {
    let level = |gpio: &Gpio, pin: usize| match gpio.pin(pin) {
        PinMode::Output(level) => Some(level),
        _ => None,
    };
    let before = gpio.clone();
    gpio.write(offset, value);
    for pin in 0..16 {
        let now_is = level(gpio, pin);
        if now_is != level(&before, pin) {
            outside.pin((port, pin), now_is, now);
        }
    }
}

/// Returns the word and the bit for an address of the bit-band alias.
pub fn bit_band(address: u32) -> Option<(u32, u32)> {
    let bit = address.checked_sub(0x4200_0000)? / 4;
    (bit < 0x0200_0000 / 4).then_some((0x4000_0000 + bit / 32 * 4, bit % 32))
}

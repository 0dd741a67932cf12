//! What several families of microcontrollers have in common: pins, and peripherals with the same registers.

mod adc;
mod dac;
mod flash;
mod gpio;
mod system_clock;
mod timer;
mod usart;
mod watchdog;

pub use adc::{Adc, AdcLayout};
pub use dac::Dac;
pub use flash::{CONTROL_KEYS, FlashSlots, OPTION_KEYS, Power, take_key};
pub use gpio::{Gpio, GpioReset};
pub use system_clock::SystemClock;
pub use timer::Timer;
pub use usart::{Usart, UsartLayout};
pub use watchdog::{Watchdog, WindowWatchdog, expired};

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

/// A pin, and the level at which it is driven.
pub type PinLevel = (Pin, Option<bool>);

/// What distinguishes a chip from others of its kind.
#[derive(Clone, Debug)]
pub struct Individual {
    /// Device number and revision.
    pub identification: u32,
    /// Size of the flash that the chip reports, KiB.
    pub flash_kib: u32,
    /// Unique number.
    pub unique: [u32; 3],
}

/// The parts on the pins.
pub trait Outside: Clone {
    /// Called when the microcontroller starts or stops driving a pin. Returns the pin to which a wire leads from
    /// there, and its level.
    fn pin(&mut self, pin: Pin, level: Option<bool>, now: Picoseconds) -> Option<PinLevel>;

    /// Returns the code that the analog-to-digital converter reads at an output of the other one, of this code.
    fn code_at_output(&mut self, channel: usize, code: u32) -> u32 {
        let _ = channel;
        code
    }

    /// Called at the end of a transfer on an SPI bus (0 for SPI1); returns the answer.
    fn transfer(&mut self, bus: usize, transfer: Transfer, now: Picoseconds) -> u16;
}

/// What is wrong with the crystal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Crystal {
    /// It never oscillates.
    Dead,
    /// It has oscillated and stops.
    Stops,
    /// It oscillates this long after it was switched on.
    Slow(Picoseconds),
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

    /// Returns the codes at the outputs of the digital-to-analog converter.
    fn dac_codes(&self) -> [u32; 2];

    /// Returns whether an output buffer limits the converter's range.
    fn dac_is_buffered(&self) -> bool;

    /// Returns how often codes were written to the converter.
    fn dac_writes(&self) -> u64;

    /// Returns the flash that keeps configurations.
    fn slots_mut(&mut self) -> &mut FlashSlots;

    /// Gives the chip the option bytes of a new one, without a brown-out level.
    fn set_new_options(&mut self);

    /// Gives the chip such a crystal.
    fn set_crystal(&mut self, failure: Crystal);

    /// Changes the supply. The chip is reset below the brown-out threshold.
    fn set_supply(&mut self, millivolts: u32);

    /// Stops the control timer.
    fn stop_control_timer(&mut self);

    /// Pulls the reset pin low for a moment.
    fn reset_pin(&mut self);

    /// Sets the phases of the prescalers of both watchdogs, which run freely: any number.
    fn set_watchdog_phase(&mut self, phase: u64);

    /// Returns what distinguishes the chip.
    fn individual_mut(&mut self) -> &mut Individual;

    /// Returns the watchdogs.
    fn watchdogs_mut(&mut self) -> (&mut Watchdog, &mut WindowWatchdog);

    /// Changes the frequency of the crystal by this many parts per million.
    fn detune_crystal(&mut self, ppm: i32);

    /// Changes bits of the option bytes, as a programmer would.
    fn flip_options(&mut self, bits: u32);

    /// Returns the serial port to the host.
    fn usart(&self) -> &Usart;

    /// Returns the serial port to the host, to send to it.
    fn usart_mut(&mut self) -> &mut Usart;

    /// Returns the time of the control timer's next interrupt.
    fn next_tick(&self) -> Picoseconds;
}

/// Returns whether a clock is within its limit, but for the tolerance of the crystal.
pub fn is_within(hz: u64, limit_hz: u64) -> bool {
    /// Largest part by which a crystal is too fast: 1 / 5000.
    const CRYSTAL: u64 = 5000;
    hz - hz / CRYSTAL <= limit_hz
}

/// Checks the pins of an SPI bus (0 for SPI1) before a transfer of `bits_hz`: clock, input and output, all on port B.
pub fn check_spi_pins(port_b: &Gpio, bus: usize, bits_hz: u64) {
    const PINS: [[usize; 3]; 2] = [[3, 4, 5], [13, 14, 15]];
    const HIGH_SPEED: u32 = 2;
    /// Fastest output at low speed, Hz (RM0090, GPIOx_OSPEEDR); bits that alternate are a clock of half their rate.
    const LOW_SPEED_HZ: u64 = 2_000_000;
    check_function(port_b, PINS[bus], 5);
    let [clock, _, output] = PINS[bus];
    assert!(
        bits_hz / 2 <= LOW_SPEED_HZ || port_b.speed(output) > 0,
        "PB{output} is slow"
    );
    // The last bit is sampled by the clock that comes back from this pin (ES0182, delayed SCK feedback).
    assert!(port_b.speed(clock) >= HIGH_SPEED, "PB{clock} is slow");
}

/// Checks an SPI's control registers before a word: a master whose select input is held high, which else goes off (MODF),
/// with both data lines, the highest bit first, no checksum, and no pause between words.
pub fn check_spi_words([first, second]: [u32; 2]) {
    const HELD_HIGH: u32 = 1 << 9 | 1 << 8;
    const LOWEST_FIRST: u32 = 1 << 7;
    const ONE_LINE: u32 = 1 << 15 | 1 << 14 | 1 << 10;
    const CHECKSUM: u32 = 1 << 13 | 1 << 12;
    const OTHER_FRAMES: u32 = 1 << 4 | 1 << 3;
    let needed = first & (HELD_HIGH | LOWEST_FIRST | ONE_LINE | CHECKSUM);
    assert_eq!(needed, HELD_HIGH, "words that no part understands");
    assert_eq!(second & OTHER_FRAMES, 0, "frames that no part understands");
}

/// Checks that pins belong to the peripheral that uses them, by the number of its function.
pub fn check_function<const N: usize>(port: &Gpio, pins: [usize; N], function: u8) {
    for pin in pins {
        assert_eq!(port.pin(pin), PinMode::Alternate(function), "pin {pin}");
    }
}

/// Performs a store to a port and reports the pins that it changes; returns those to which wires lead from them.
pub fn store_port(
    gpio: &mut Gpio,
    port: usize,
    (offset, value): (u32, u32),
    outside: &mut impl Outside,
    now: Picoseconds,
) -> Vec<PinLevel> {
    let level = |gpio: &Gpio, pin: usize| match gpio.pin(pin) {
        PinMode::Output(level) => Some(level),
        _ => None,
    };
    let before = gpio.clone();
    gpio.write(offset, value);
    let mut wired = Vec::new();
    for pin in 0..16 {
        let now_is = level(gpio, pin);
        if now_is != level(&before, pin) {
            wired.extend(outside.pin((port, pin), now_is, now));
        }
    }
    wired
}

/// Carries levels to the pins to which wires lead. A falling edge at PA0 is captured by the control timer, of clock
/// `hz`, if the pin belongs to it.
pub fn carry(ports: &mut [Gpio], timer: &mut Timer, wired: &[PinLevel], hz: u64, now: Picoseconds) {
    const CAPTURED: Pin = (0, 0);
    for ((port, number), level) in wired {
        let gpio = &mut ports[*port];
        let falls = gpio.external[*number] != Some(false) && *level == Some(false);
        gpio.external[*number] = *level;
        if (*port, *number) == CAPTURED && falls && gpio.pin(0) == PinMode::Alternate(1) {
            timer.capture(hz, now);
        }
    }
}

//! The STM32F405's peripherals that the image uses (RM0090). An access to any other address ends
//! the test.

mod dma;
mod rcc;
mod spi;

use self::dma::{Dma, Request};
pub use self::rcc::Rcc;
pub use self::spi::Spi;
use crate::bit_band::{AliasedBit, bit_band};
use crate::machine::{Chip, Reset};
use crate::stm32::{
    Adc, AdcLayout, CONTROL_KEYS, Crystal, Dac, FlashSlots, Gpio, GpioReset, Individual,
    OPTION_KEYS, Outside, Pin, PinLevel, PinMode, Power, Timer, Usart, UsartLayout, Watchdog,
    WindowWatchdog, WiredChip, carry, check_function, check_spi_pins, expired, is_within,
    store_port, take_key,
};
use crate::unicorn::Processor;
use crate::{MICROSECOND, MILLISECOND, Picoseconds};

/// Interrupt numbers.
const PVD: usize = 1;
const TIM2: usize = 28;
const SPIS: [usize; 2] = [35, 36];
const USART1: usize = 37;
const DMA1_STREAMS: [usize; 8] = [11, 12, 13, 14, 15, 16, 17, 47];
const DMA2_STREAMS: [usize; 8] = [56, 57, 58, 59, 60, 68, 69, 70];

/// Pins of port A for the serial port, and the number of their function.
const USART_PINS: [usize; 2] = [9, 10];
const USART_FUNCTION: u8 = 7;

/// Requests of USART1 at DMA2.
const RECEIVED: Request = Request {
    streams: &[2, 5],
    channel: 4,
    data: 0x4001_1004,
    to_memory: true,
};
const TO_SEND: Request = Request {
    streams: &[7],
    channel: 4,
    data: 0x4001_1004,
    to_memory: false,
};

/// Bits of the flash's control register (RM0090, section 3.9.5).
const LOCK: u32 = 1 << 31;
const START: u32 = 1 << 16;
const SECTOR_ERASE: u32 = 2;
const PROGRAM: u32 = 1;
const WIDTH: u32 = 3 << 8;

/// Error of an operation in a protected sector.
const WRITE_PROTECTED: u32 = 1 << 4;

/// Bit of PWR_CR for the regulator's first scale.
const FULL_SCALE: u32 = 1 << 14;

/// Highest clock in either scale, and per wait state of the flash, Hz.
const FASTEST_HZ: u64 = 168_000_000;
const SECOND_SCALE_HZ: u64 = 144_000_000;
const PER_WAIT_STATE_HZ: u64 = 30_000_000;

/// Bits of the digital-to-analog converter's control register that are modelled: channels on, and their buffers off.
const CONVERTER: u32 = 0x0003_0003;

/// Stores of four bytes.
const WORDS: u32 = 2 << 8;

/// Bits of the option bytes' register: it is locked, and their programming starts.
const OPTION_LOCK: u32 = 1;
const OPTION_START: u32 = 2;

/// Option bytes of a new chip, and those with the highest brown-out level.
const NEW_OPTIONS: u32 = 0x0fff_aaed;
const USUAL_OPTIONS: u32 = 0x0fff_aae1;

/// Longest programming of the option bytes: the manual gives no time. Their sector is erased before, and the data
/// sheet's shortest sector, of 16 KiB, takes up to 800 ms.
const OPTION_TIME: Picoseconds = 800 * MILLISECOND;

/// Longest programming of a word by the data sheet; it usually takes 16 µs.
const WORD_TIME: Picoseconds = 100 * MICROSECOND;

/// Shorter than in the data sheet, where it takes up to 2 s, so that tests need not wait unless they set it.
const SHORT_ERASURE: Picoseconds = MILLISECOND;

/// First sector of the slots, and its length.
const FIRST_SECTOR: u32 = 10;
const SECTOR: usize = 128 << 10;

/// After a reset the debugger's pins of ports A and B are alternate functions.
fn gpio_reset(port: usize) -> GpioReset {
    match port {
        0 => (0xa800_0000, 0x0c00_0000, 0x6400_0000),
        1 => (0x0000_0280, 0x0000_00c0, 0x0000_0100),
        _ => (0, 0, 0),
    }
}

/// The chip with the parts on its pins.
#[derive(Clone)]
pub struct Stm32f4<O> {
    /// The parts on the pins.
    pub outside: O,
    /// Clocks.
    pub rcc: Rcc,
    ports: [Gpio; 8],
    spis: [Spi; 2],
    /// The serial port to the host.
    pub usart: Usart,
    /// The control timer.
    pub timer: Timer,
    /// The watchdog.
    pub watchdog: Watchdog,
    /// The window watchdog.
    pub window_watchdog: WindowWatchdog,
    dac: Dac,
    adc: Adc,
    individual: Individual,
    dma: [Dma; 2],
    power: [u32; 2],
    /// Supply voltage, mV.
    supply_mv: u32,
    flash_control: [u32; 8],
    slots: FlashSlots,
    /// Errors in the flash's status register.
    flash_errors: u32,
    /// Option bytes as programmed, and those that the last reset has loaded, which count. Their register gives what was
    /// written to it.
    programmed_options: u32,
    loaded_options: u32,
    /// Time until which the option bytes are programmed.
    options_busy_until: Picoseconds,
    /// Number of keys that have come for the flash's control register and for the option bytes.
    keys: [usize; 2],
    syscfg: [u32; 16],
    external_interrupts: [u32; 8],
    /// The register of debug control that says which clocks run on in sleep.
    debug: u32,
    reset: Option<Reset>,
}

impl<O: Outside> Stm32f4<O> {
    /// Creates the chip without power; `oscillator_hz` is that of the watchdog, 17 to 47 kHz.
    pub fn new(outside: O, oscillator_hz: u64) -> Self {
        Self {
            outside,
            rcc: Rcc::new(),
            ports: std::array::from_fn(|port| Gpio::new(gpio_reset(port))),
            spis: Default::default(),
            usart: Usart::new(UsartLayout::SharedData),
            timer: Timer::default(),
            watchdog: Watchdog::new(oscillator_hz),
            window_watchdog: WindowWatchdog::new(7, 2),
            dac: Dac::default(),
            adc: Adc::new(AdcLayout::Plain),
            individual: Individual {
                identification: 0x1007_6413,
                flash_kib: 1024,
                unique: [0x0032_0021, 0x3431_510c, 0x3837_3830],
            },
            dma: Default::default(),
            power: [0x4000, 0],
            supply_mv: 3300,
            flash_control: [0, 0, 0, 0, LOCK, USUAL_OPTIONS, 0, 0],
            slots: FlashSlots::new(Self::SLOTS.1, SHORT_ERASURE),
            flash_errors: 0,
            programmed_options: USUAL_OPTIONS,
            loaded_options: USUAL_OPTIONS,
            options_busy_until: 0,
            keys: [0; 2],
            syscfg: [0; 16],
            external_interrupts: [0; 8],
            debug: 0,
            reset: None,
        }
    }

    /// Returns the state of the supply supervisor.
    fn supply_is_low(&self) -> bool {
        let thresholds = [2000, 2100, 2300, 2500, 2600, 2700, 2800, 2900];
        let threshold = thresholds[(self.power[0] >> 5 & 7) as usize];
        self.power[0] & 1 << 4 != 0 && self.supply_mv < threshold
    }

    /// Passes a rising edge of the supply supervisor on to its interrupt line, which may not wait for it yet.
    fn note_supply(&mut self, was_low: bool) {
        if self.supply_is_low() && !was_low {
            self.external_interrupts[5] |= self.external_interrupts[2] & 1 << 16;
        }
    }

    fn load(&mut self, address: u32, now: Picoseconds) -> u32 {
        let offset = address & 0x3ff;
        match address & !0x3ff {
            0x4000_0000 if self.rcc.is_on(0x40, 0) => match offset {
                0x34 => self.timer.take_capture(),
                _ => self.timer.read(offset, self.rcc.slow_timer_hz(), now),
            },
            0x4000_2c00 if self.rcc.is_on(0x40, 11) => self.window_watchdog.read(offset),
            0x4000_3000 => self.watchdog.read(offset, now),
            0x4000_3800 if self.rcc.is_on(0x40, 14) => self.spis[1].read(offset),
            0x4000_7000 if self.rcc.is_on(0x40, 28) => match offset {
                // Voltage scaling is always ready.
                0x04 => self.power[1] | 0x4000 | u32::from(self.supply_is_low()) << 2,
                _ => self.power[0],
            },
            0x4000_7400 if self.rcc.is_on(0x40, 29) => self.dac.read(offset),
            0x4001_1000 if self.rcc.is_on(0x44, 4) => self.usart.read(offset),
            0x4001_2000 if self.rcc.is_on(0x44, 8) => self.adc.read(offset, now),
            0x4001_3000 if self.rcc.is_on(0x44, 12) => self.spis[0].read(offset),
            0x4001_3800 => self.syscfg[((offset / 4) & 15) as usize],
            0x4001_3c00 => self.external_interrupts[((offset / 4) & 7) as usize],
            0x4002_0000..0x4002_2000 => {
                let port = ((address - 0x4002_0000) / 0x400) as usize;
                if self.rcc.is_on(0x30, port as u32) {
                    self.ports[port].read(offset)
                } else {
                    0
                }
            }
            0x4002_3800 => self.rcc.read(offset, now),
            0x4002_3c00 if offset == 0x0c => {
                u32::from(self.flash_is_busy(now)) << 16 | self.flash_errors
            }
            0x4002_3c00 => self.flash_control[((offset / 4) & 7) as usize],
            0x4002_6000 if self.rcc.is_on(0x30, 21) => self.dma[0].read(offset),
            0x4002_6400 if self.rcc.is_on(0x30, 22) => self.dma[1].read(offset),
            // A peripheral whose clock is off.
            0x4000_0000 | 0x4000_2c00 | 0x4000_3800 | 0x4000_7000 | 0x4000_7400 | 0x4001_1000
            | 0x4001_2000 | 0x4001_3000 | 0x4002_6000 | 0x4002_6400 => 0,
            // Unique number and size of the flash.
            0x1fff_7800 => match offset {
                0x210 | 0x214 | 0x218 => self.individual.unique[((offset - 0x210) / 4) as usize],
                0x220 => self.individual.flash_kib << 16,
                _ => 0,
            },
            0xe004_2000 if offset == 0 => self.individual.identification,
            0xe004_2000 if offset == 4 => self.debug,
            _ => panic!("load from {address:#010x}, which is not modelled"),
        }
    }

    fn store(&mut self, address: u32, value: u32, now: Picoseconds) {
        let offset = address & 0x3ff;
        let (slow, fast) = (self.rcc.slow_bus_hz(), self.rcc.fast_bus_hz());
        match address & !0x3ff {
            0x4000_0000 if self.rcc.is_on(0x40, 0) => {
                let hz = self.rcc.slow_timer_hz();
                self.timer.write(offset, value, hz, now);
            }
            0x4000_2c00 if self.rcc.is_on(0x40, 11) => {
                self.window_watchdog.write(offset, value, slow, now);
            }
            0x4000_3000 => self.watchdog.write(offset, value, now),
            0x4000_3800 if self.rcc.is_on(0x40, 14) => {
                self.spis[1].write(offset, value, slow, now);
            }
            0x4000_7000 if self.rcc.is_on(0x40, 28) => {
                let was_low = self.supply_is_low();
                self.power[usize::from(offset != 0)] = value;
                self.note_supply(was_low);
                self.check_clock();
            }
            0x4000_7400 if self.rcc.is_on(0x40, 29) => {
                self.dac.write(offset, value);
                assert_eq!(self.dac.control & !CONVERTER, 0, "a trigger or a wave");
            }
            0x4001_1000 if self.rcc.is_on(0x44, 4) => self.usart.write(offset, value, fast, now),
            0x4001_2000 if self.rcc.is_on(0x44, 8) => {
                let (dac, outside) = (&self.dac, &mut self.outside);
                let sample = |channel: u32| {
                    let output = [4, 5].iter().position(|it| *it == channel);
                    let output = output.expect("a channel at an output of the other converter");
                    outside.code_at_output(output, dac.outputs()[output])
                };
                self.adc.write((offset, value), fast, now, sample);
            }
            0x4001_3000 if self.rcc.is_on(0x44, 12) => {
                self.spis[0].write(offset, value, fast, now);
            }
            0x4001_3800 if self.rcc.is_on(0x44, 14) => {
                self.syscfg[((offset / 4) & 15) as usize] = value;
            }
            0x4001_3c00 if offset == 0x14 => self.external_interrupts[5] &= !value,
            0x4001_3c00 => self.external_interrupts[((offset / 4) & 7) as usize] = value,
            0x4002_0000..0x4002_2000 => {
                let port = ((address - 0x4002_0000) / 0x400) as usize;
                if self.rcc.is_on(0x30, port as u32) {
                    let gpio = &mut self.ports[port];
                    let wired = store_port(gpio, port, (offset, value), &mut self.outside, now);
                    self.carry(&wired, now);
                }
            }
            0x4002_3800 => {
                self.rcc.write(offset, value, now);
                self.check_clock();
                if self.rcc.is_on(0x20, 0) {
                    self.timer.reset();
                }
            }
            0x4002_3c00 => {
                self.store_flash(offset, value, now);
                self.check_clock();
            }
            0x4002_6000 if self.rcc.is_on(0x30, 21) => self.dma[0].write(offset, value),
            0x4002_6400 if self.rcc.is_on(0x30, 22) => self.dma[1].write(offset, value),
            0x4000_0000 | 0x4000_2c00 | 0x4000_3800 | 0x4000_7000 | 0x4000_7400 | 0x4001_1000
            | 0x4001_2000 | 0x4001_3000 | 0x4002_6000 | 0x4002_6400 => {}
            0xe004_2000 if offset == 4 => self.debug = value,
            // The rest of debug control.
            0xe004_2000 => {}
            _ => panic!("store of {value:#x} to {address:#010x}, which is not modelled"),
        }
    }

    /// Checks buses, regulator and flash for the clock (RM0090, sections 3.5.1 and 5.1.3, at 2.7 V to 3.6 V).
    fn check_clock(&self) {
        let core_hz = self.rcc.core_hz();
        let regulator_hz = if self.power[0] & FULL_SCALE != 0 {
            FASTEST_HZ
        } else {
            SECOND_SCALE_HZ
        };
        let wait_states = u64::from(self.flash_control[0] & 7);
        assert!(
            is_within(core_hz, regulator_hz)
                && is_within(self.rcc.slow_bus_hz(), FASTEST_HZ / 4)
                && is_within(self.rcc.fast_bus_hz(), FASTEST_HZ / 2)
                && is_within(core_hz, (wait_states + 1) * PER_WAIT_STATE_HZ),
            "{core_hz} Hz with {wait_states} wait states"
        );
    }

    /// Handles the keys that unlock the option bytes, which hold the brown-out level, and those that unlock the
    /// control register.
    fn store_flash(&mut self, offset: u32, value: u32, now: Picoseconds) {
        let is_open = self.flash_control[4] & LOCK == 0;
        match offset {
            0x04 if take_key(CONTROL_KEYS, &mut self.keys[0], value) => {
                self.flash_control[4] &= !LOCK;
            }
            0x08 if take_key(OPTION_KEYS, &mut self.keys[1], value) => {
                self.flash_control[5] &= !OPTION_LOCK;
            }
            0x0c => self.flash_errors &= !value,
            0x10 if is_open => {
                assert!(!self.flash_is_busy(now), "the flash is busy");
                self.flash_control[4] = value & !START;
                if value & START != 0 && value & SECTOR_ERASE != 0 {
                    assert_eq!(value & WIDTH, WORDS, "the width of an erasure");
                    let slot = (value >> 3 & 15) - FIRST_SECTOR;
                    if self.is_write_protected(slot) {
                        return;
                    }
                    let power = self.slots.erase(slot as usize * SECTOR, SECTOR, now);
                    self.note_power(power);
                }
            }
            0x14 if self.flash_control[5] & OPTION_LOCK == 0 => {
                assert!(!self.flash_is_busy(now), "the flash is busy");
                self.flash_control[5] = value & !OPTION_START;
                if value & OPTION_START != 0 {
                    self.programmed_options = self.flash_control[5];
                    self.options_busy_until = now + OPTION_TIME;
                }
            }
            0x00 => self.flash_control[0] = value,
            _ => {}
        }
    }
}

impl<O> Stm32f4<O> {
    fn flash_is_busy(&self, now: Picoseconds) -> bool {
        self.slots.is_busy(now) || now < self.options_busy_until
    }

    fn carry(&mut self, wired: &[PinLevel], now: Picoseconds) {
        let hz = self.rcc.slow_timer_hz();
        carry(&mut self.ports, &mut self.timer, wired, hz, now);
    }

    /// Loads the option bytes, as every reset does.
    fn load_options(&mut self) {
        self.loaded_options = self.programmed_options;
        self.flash_control[5] = self.programmed_options | OPTION_LOCK;
    }

    /// Notes an error if the option bytes protect a slot.
    fn is_write_protected(&mut self, slot: u32) -> bool {
        let is_protected = self.loaded_options >> (16 + FIRST_SECTOR + slot) & 1 == 0;
        self.flash_errors |= u32::from(is_protected) * WRITE_PROTECTED;
        is_protected
    }

    fn note_power(&mut self, power: Power) {
        if power == Power::Failed {
            self.reset = Some(Reset::Power);
        }
    }

    fn store_slot(&mut self, offset: u32, word: u32, size: u32, now: Picoseconds) {
        let control = self.flash_control[4];
        assert!(!self.flash_is_busy(now), "the flash is busy");
        assert_eq!(size, 4, "the width of a store");
        assert_eq!(control & (LOCK | WIDTH | PROGRAM), WORDS | PROGRAM);
        if self.is_write_protected(offset / SECTOR as u32) {
            return;
        }
        let until = now + WORD_TIME;
        let power = self
            .slots
            .program(offset as usize, &word.to_le_bytes(), until);
        self.note_power(power);
    }
}

impl<O: Outside> Chip for Stm32f4<O> {
    const FLASH: (u32, usize) = (0x0800_0000, 1 << 20);
    const SLOTS: (u32, usize) = (0x080c_0000, 2 * SECTOR);
    const RAM: (u32, usize) = (0x2000_0000, 128 << 10);
    const ALIASED_RAM: usize = 112 << 10;
    const REGISTERS: &'static str = include_str!("../registers/stm32f405.txt");

    fn reset(&mut self, reset: Reset, now: Picoseconds) {
        assert!(
            now >= self.options_busy_until,
            "{reset:?} spoils the option bytes"
        );
        for (number, port) in self.ports.iter_mut().enumerate() {
            port.reset(gpio_reset(number));
        }
        for pin in (0..8).flat_map(|port| (0..16).map(move |pin| (port, pin))) {
            let wired = self.outside.pin(pin, None, now);
            self.carry(wired.as_slice(), now);
        }
        self.rcc.reset(reset);
        self.spis = Default::default();
        self.usart.reset();
        self.timer = Timer::default();
        self.watchdog.reset();
        self.window_watchdog.reset();
        self.dac.reset();
        self.adc = Adc::new(AdcLayout::Plain);
        self.dma = Default::default();
        self.power = [0x4000, 0];
        self.flash_control[0] = 0;
        self.flash_control[4] = LOCK;
        self.keys = [0; 2];
        self.flash_errors = 0;
        self.slots.reset(now);
        self.load_options();
        self.syscfg = [0; 16];
        self.external_interrupts = [0; 8];
        if matches!(reset, Reset::Power | Reset::BrownOut) {
            self.debug = 0;
        }
        self.reset = None;
    }

    fn read(&mut self, address: u32, size: u32, now: Picoseconds) -> u32 {
        if let Some(AliasedBit { word, bit }) = bit_band(address) {
            return self.load(word, now) >> bit & 1;
        }
        let word = match address.checked_sub(Self::SLOTS.0) {
            Some(offset) if offset < Self::SLOTS.1 as u32 => {
                assert!(!self.flash_is_busy(now), "the flash is busy");
                self.slots.word(offset)
            }
            _ => self.load(address & !3, now),
        };
        let value = word >> (8 * (address & 3));
        match size {
            1 => value & 0xff,
            2 => value & 0xffff,
            _ => value,
        }
    }

    fn write(&mut self, address: u32, size: u32, value: u32, now: Picoseconds) {
        if let Some(AliasedBit { word, bit }) = bit_band(address) {
            let before = self.load(word, now);
            return self.store(word, before & !(1 << bit) | (value & 1) << bit, now);
        }
        if let Some(offset) = address.checked_sub(Self::SLOTS.0)
            && offset < Self::SLOTS.1 as u32
        {
            return self.store_slot(offset, value, size, now);
        }
        self.store(address, value, now);
    }

    fn advance(&mut self, now: Picoseconds, memory: &Processor) {
        if self.rcc.advance(now) {
            self.check_clock();
        }
        let (slow, fast) = (self.rcc.slow_bus_hz(), self.rcc.fast_bus_hz());
        self.timer.advance(self.rcc.slow_timer_hz(), now);
        for (bus, hz) in [fast, slow].into_iter().enumerate() {
            while let Some(transfer) = self.spis[bus].ended(now) {
                check_spi_pins(&self.ports[1], bus, transfer.hz);
                let received = self.outside.transfer(bus, transfer, now);
                self.spis[bus].complete(received, hz);
            }
        }
        loop {
            self.usart.advance(fast, now);
            if self.usart.wants_reading() && self.dma[1].serves(RECEIVED) {
                check_function(&self.ports[0], USART_PINS, USART_FUNCTION);
                let byte = self.usart.take();
                self.dma[1].store_byte(RECEIVED, byte, memory);
            }
            if self.usart.wants_writing()
                && let Some(byte) = self.dma[1].load_byte(TO_SEND, memory)
            {
                check_function(&self.ports[0], USART_PINS, USART_FUNCTION);
                self.usart.bring(byte, fast, now);
            }
            if self.usart.next_event() > now {
                break;
            }
        }
        let expired = expired(&self.watchdog, &self.window_watchdog, now);
        self.reset = expired.or(self.reset);
    }

    fn next_event(&self) -> Picoseconds {
        let timer = self.timer.next_event(self.rcc.slow_timer_hz());
        let sends = self.usart.wants_writing() && self.dma[1].serves(TO_SEND);
        let spis = self.spis[0].next_event().min(self.spis[1].next_event());
        timer
            .min(spis)
            .min(self.rcc.next_event())
            .min(self.usart.next_event())
            .min(self.watchdog.expires())
            .min(self.window_watchdog.expires())
            .min(if sends { 0 } else { Picoseconds::MAX })
    }

    /// The flash has one bank.
    fn flash_is_stalled(&self, now: Picoseconds) -> bool {
        self.flash_is_busy(now)
    }

    /// Returns whether SYSCFG_MEMRMP maps SRAM1 to address 0 (RM0090, section 9.2.1).
    fn ram_is_at_zero(&self) -> bool {
        self.syscfg[0] & 3 == 3
    }

    fn interrupt_lines(&self) -> u128 {
        let mut lines = u128::from(self.timer.interrupts()) << TIM2
            | u128::from(self.usart.interrupts()) << USART1
            | u128::from(self.external_interrupts[5] & self.external_interrupts[0] & 1 << 16 != 0)
                << PVD;
        for (spi, line) in self.spis.iter().zip(SPIS) {
            lines |= u128::from(spi.interrupts()) << line;
        }
        for stream in 0..8 {
            lines |= u128::from(self.dma[0].interrupts(stream)) << DMA1_STREAMS[stream];
            lines |= u128::from(self.dma[1].interrupts(stream)) << DMA2_STREAMS[stream];
        }
        lines
    }

    fn take_nmi(&mut self) -> bool {
        self.rcc.nmi
    }

    fn wants_reset(&self) -> bool {
        self.reset.is_some()
    }

    fn take_reset(&mut self) -> Option<Reset> {
        self.reset.take()
    }

    fn core_hz(&self) -> u64 {
        self.rcc.core_hz()
    }

    fn is_clocked_in_sleep(&self) -> bool {
        self.debug & 1 != 0
    }
}

impl<O: Outside> WiredChip for Stm32f4<O> {
    type Outside = O;

    const OSCILLATOR_HZ: [u64; 3] = [17_000, 32_000, 47_000];

    fn without_power(outside: O, oscillator_hz: u64) -> Self {
        Self::new(outside, oscillator_hz)
    }

    fn outside_mut(&mut self) -> &mut O {
        &mut self.outside
    }

    fn pin(&self, (port, number): Pin) -> PinMode {
        self.ports[port].pin(number)
    }

    fn drive_pin(&mut self, (port, number): Pin, level: Option<bool>) {
        self.ports[port].external[number] = level;
    }

    fn dac_codes(&self) -> [u32; 2] {
        self.dac.outputs()
    }

    fn dac_is_buffered(&self) -> bool {
        self.dac.control & 0x0002_0002 != 0x0002_0002
    }

    fn dac_writes(&self) -> u64 {
        self.dac.writes
    }

    fn set_supply(&mut self, millivolts: u32) {
        let was_low = self.supply_is_low();
        self.supply_mv = millivolts;
        let level = self.loaded_options >> 2 & 3;
        let threshold = [2700, 2400, 2100, 1800][level as usize];
        if millivolts < threshold {
            self.reset = Some(Reset::BrownOut);
        }
        self.note_supply(was_low);
    }

    fn reset_pin(&mut self) {
        self.reset = Some(Reset::Pin);
    }

    fn set_watchdog_phase(&mut self, phase: u64) {
        self.watchdog.phase = phase;
        self.window_watchdog.phase = phase;
    }

    fn slots_mut(&mut self) -> &mut FlashSlots {
        &mut self.slots
    }

    fn set_new_options(&mut self) {
        self.programmed_options = NEW_OPTIONS;
        self.load_options();
    }

    fn set_crystal(&mut self, failure: Crystal) {
        match failure {
            Crystal::Dead => self.rcc.crystal_works = false,
            Crystal::Stops => self.rcc.stop_crystal(),
            Crystal::Slow(start) => self.rcc.crystal_start = start,
        }
    }

    fn stop_control_timer(&mut self) {
        self.timer = Timer::default();
    }

    fn individual_mut(&mut self) -> &mut Individual {
        &mut self.individual
    }

    fn watchdogs_mut(&mut self) -> (&mut Watchdog, &mut WindowWatchdog) {
        (&mut self.watchdog, &mut self.window_watchdog)
    }

    fn detune_crystal(&mut self, ppm: i32) {
        self.rcc.detune(ppm);
    }

    fn flip_options(&mut self, bits: u32) {
        self.programmed_options ^= bits;
        self.load_options();
    }

    fn usart(&self) -> &Usart {
        &self.usart
    }

    fn usart_mut(&mut self) -> &mut Usart {
        &mut self.usart
    }

    fn next_tick(&self) -> Picoseconds {
        self.timer.next_event(self.rcc.slow_timer_hz())
    }
}

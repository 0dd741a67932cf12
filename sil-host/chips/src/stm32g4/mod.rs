//! The STM32G474's peripherals that the image uses (RM0440). An access to any other address ends the test.

mod dma;
mod flash;
mod rcc;
mod spi;

use self::dma::{Dma, Request};
use self::flash::{Flash, SLOTS};
pub use self::rcc::Rcc;
use self::rcc::bus;
pub use self::spi::Spi;
use crate::Picoseconds;
use crate::bit_band::{AliasedBit, bit_band};
use crate::machine::{Chip, Reset};
use crate::stm32::{
    Adc, AdcLayout, Crystal, Dac, FlashSlots, Gpio, GpioReset, Individual, Outside, Pin, PinLevel,
    PinMode, Power, Timer, Usart, UsartLayout, Watchdog, WindowWatchdog, WiredChip, carry,
    check_function, check_spi_pins, expired, is_within, store_port,
};
use crate::unicorn::Processor;

/// Interrupt numbers.
const PVD: usize = 1;
const TIM2: usize = 28;
const SPIS: [usize; 2] = [35, 36];
const USART2: usize = 38;

/// Pins of port A for the serial port, and the number of their function.
const USART_PINS: [usize; 2] = [2, 3];
const USART_FUNCTION: u8 = 7;

/// Requests of USART2.
const RECEIVED: Request = Request {
    number: 26,
    data: 0x4000_4424,
    to_memory: true,
};
const TO_SEND: Request = Request {
    number: 27,
    data: 0x4000_4428,
    to_memory: false,
};

/// Bit of PWR_CR5 without which the regulator is in its boost mode.
const BOOST_OFF: u32 = 1 << 8;

/// Bits of the digital-to-analog converter's control register that are modelled: channels on.
const CONVERTER: u32 = 0x0001_0001;

/// Highest clock without and with the regulator's boost mode, Hz, and most wait states of the flash, each for an
/// equal part of it.
const FASTEST_HZ: [u64; 2] = [150_000_000, 170_000_000];
const MOST_WAIT_STATES: u64 = 4;

/// After a reset all pins are analogue, except the debugger's.
fn gpio_reset(port: usize) -> GpioReset {
    match port {
        0 => (0xabff_ffff, 0x0c00_0000, 0x6400_0000),
        1 => (0xffff_febf, 0x0000_00c0, 0x0000_0100),
        _ => (0xffff_ffff, 0, 0),
    }
}

/// The chip with the parts on its pins.
#[derive(Clone)]
pub struct Stm32g4<O> {
    /// The parts on the pins.
    pub outside: O,
    /// Clocks.
    pub rcc: Rcc,
    ports: [Gpio; 7],
    spis: [Spi; 2],
    /// The serial port to the host.
    pub usart: Usart,
    timer: Timer,
    watchdog: Watchdog,
    window_watchdog: WindowWatchdog,
    dac: Dac,
    adc: Adc,
    individual: Individual,
    dma: Dma,
    power: [u32; 33],
    /// Supply voltage, mV.
    supply_mv: u32,
    flash: Flash,
    external_interrupts: [u32; 16],
    /// The register of debug control that says which clocks run on in sleep.
    debug: u32,
    reset: Option<Reset>,
}

impl<O: Outside> Stm32g4<O> {
    /// Returns the state of the supply supervisor.
    fn supply_is_low(&self) -> bool {
        let thresholds = [2000, 2200, 2400, 2500, 2600, 2800, 2900, 0];
        let threshold = thresholds[(self.power[1] >> 1 & 7) as usize];
        self.power[1] & 1 != 0 && self.supply_mv < threshold
    }

    /// Passes a rising edge of the supply supervisor on to its interrupt line, which may not wait for it yet.
    fn note_supply(&mut self, was_low: bool) {
        if self.supply_is_low() && !was_low {
            self.external_interrupts[5] |= self.external_interrupts[2] & 1 << 16;
        }
    }

    fn is_on(&self, address: u32) -> bool {
        let on = |register, bit| self.rcc.is_on(register, bit);
        match address & !0x3ff {
            0x4000_0000 => on(bus::APB1, 0),
            0x4000_2c00 => on(bus::APB1, 11),
            0x4000_3800 => on(bus::APB1, 14),
            0x4000_4400 => on(bus::APB1, 17),
            0x4000_7000 => on(bus::APB1, 28),
            0x4001_3000 => on(bus::APB2, 12),
            0x4002_0000 => on(bus::AHB1, 0),
            0x4002_0800 => on(bus::AHB1, 2),
            0x5000_0000 => on(bus::AHB2, 13),
            0x5000_0800 => on(bus::AHB2, 16),
            0x4800_0000..0x4800_1c00 => on(bus::AHB2, address >> 10 & 7),
            // Independent watchdog, interrupt lines, clock control, flash, numbers of the chip.
            0x4000_3000 | 0x4001_0400 | 0x4002_1000 | 0x4002_2000 | 0x1fff_7400 | 0xe004_2000 => {
                true
            }
            _ => panic!("access to {address:#010x}, which is not modelled"),
        }
    }

    fn load(&mut self, address: u32, size: u32, now: Picoseconds) -> u32 {
        let offset = address & 0x3ff;
        if !self.is_on(address) {
            return 0;
        }
        match address & !0x3ff {
            0x4000_0000 if offset == 0x34 => self.timer.take_capture(),
            0x4000_0000 => self.timer.read(offset, self.rcc.bus_hz(), now),
            0x4000_2c00 => self.window_watchdog.read(offset),
            0x4000_3000 => self.watchdog.read(offset, now),
            0x4000_3800 => self.spis[1].read(offset, size),
            0x4000_4400 => self.usart.read(offset),
            0x4000_7000 => match offset {
                0x14 => u32::from(self.supply_is_low()) << 11,
                _ => self.power[((offset / 4) as usize).min(32)],
            },
            0x4001_0400 => self.external_interrupts[((offset / 4) & 15) as usize],
            0x4001_3000 => self.spis[0].read(offset, size),
            0x4002_0000 => self.dma.read(offset),
            0x4002_0800 => self.dma.read_multiplexer(offset),
            0x4002_1000 => self.rcc.read(offset, now),
            0x4002_2000 => self.flash.read(offset, now),
            0x5000_0000 => self.adc.read(offset, now),
            0x5000_0800 => self.dac.read(offset),
            0x1fff_7400 => match offset {
                0x190 | 0x194 | 0x198 => self.individual.unique[((offset - 0x190) / 4) as usize],
                0x1e0 => 0xffff_0000 | self.individual.flash_kib,
                _ => 0,
            },
            0xe004_2000 if offset == 0 => self.individual.identification,
            0xe004_2000 if offset == 4 => self.debug,
            0xe004_2000 => 0,
            _ => self.ports[(address >> 10 & 7) as usize].read(offset),
        }
    }

    fn store(&mut self, address: u32, value: u32, size: u32, now: Picoseconds) {
        let offset = address & 0x3ff;
        if !self.is_on(address) {
            return;
        }
        let hz = self.rcc.bus_hz();
        match address & !0x3ff {
            0x4000_0000 => self.timer.write(offset, value, hz, now),
            0x4000_2c00 => self.window_watchdog.write(offset, value, hz, now),
            0x4000_3000 => self.watchdog.write(offset, value, now),
            0x4000_3800 => self.spis[1].write(offset, (value, size), hz, now),
            0x4000_4400 => self.usart.write(offset, value, hz, now),
            0x4000_7000 => {
                let was_low = self.supply_is_low();
                self.power[((offset / 4) as usize).min(32)] = value;
                self.note_supply(was_low);
                let boosts = offset == 0x80 && value & BOOST_OFF == 0;
                assert!(!boosts || self.rcc.is_divided(), "boost before the divider");
                self.check_clock();
            }
            0x4001_0400 if offset == 0x14 => self.external_interrupts[5] &= !value,
            0x4001_0400 => self.external_interrupts[((offset / 4) & 15) as usize] = value,
            0x4001_3000 => self.spis[0].write(offset, (value, size), hz, now),
            0x4002_0000 => self.dma.write(offset, value),
            0x4002_0800 => self.dma.write_multiplexer(offset, value),
            0x4002_1000 => {
                self.rcc.write(offset, value, now);
                self.check_clock();
            }
            0x4002_2000 => {
                let power = self.flash.write(offset, value, now);
                self.note_power(power);
                self.check_clock();
            }
            0x5000_0000 => {
                let (dac, outside) = (&self.dac, &mut self.outside);
                let sample = |channel: u32| {
                    let output = [17, 13].iter().position(|it| *it == channel);
                    let output = output.expect("a channel at an output of the other converter");
                    outside.code_at_output(output, dac.outputs()[output])
                };
                self.adc.write((offset, value), hz, now, sample);
            }
            0x5000_0800 => {
                self.dac.write(offset, value);
                self.check_converter(hz);
            }
            0xe004_2000 if offset == 4 => self.debug = value,
            // The rest of debug control.
            0xe004_2000 => {}
            0x1fff_7400 => panic!("store to {address:#010x}, which cannot change"),
            _ => {
                let port = (address >> 10 & 7) as usize;
                let gpio = &mut self.ports[port];
                let wired = store_port(gpio, port, (offset, value), &mut self.outside, now);
                self.carry(&wired, now);
            }
        }
    }

    /// Checks that the digital-to-analog converter knows of a fast bus (RM0440, DAC_MCR: HFSEL).
    fn check_converter(&self, hz: u64) {
        assert_eq!(self.dac.control & !CONVERTER, 0, "a trigger or a wave");
        let is_on = self.dac.control & 0x0001_0001 != 0;
        let needed = u32::from(hz > 80_000_000) + u32::from(hz > 160_000_000);
        assert!(
            !is_on || self.dac.modes >> 14 & 3 >= needed,
            "HFSEL at {hz} Hz"
        );
    }

    /// Checks regulator and flash for the clock (RM0440, chapters PWR and FLASH).
    fn check_clock(&self) {
        let (system_hz, core_hz) = (self.rcc.system_hz(), self.rcc.core_hz());
        let fastest_hz = FASTEST_HZ[usize::from(self.power[32] & BOOST_OFF == 0)];
        assert!(
            is_within(system_hz, fastest_hz),
            "{system_hz} Hz is too fast for the regulator's mode"
        );
        let wait_states = self.flash.wait_states().min(MOST_WAIT_STATES);
        let limit_hz = (wait_states + 1) * fastest_hz / (MOST_WAIT_STATES + 1);
        assert!(
            is_within(core_hz, limit_hz),
            "{core_hz} Hz with {wait_states} wait states"
        );
    }
}

impl<O> Stm32g4<O> {
    fn carry(&mut self, wired: &[PinLevel], now: Picoseconds) {
        let hz = self.rcc.bus_hz();
        carry(&mut self.ports, &mut self.timer, wired, hz, now);
    }

    fn note_power(&mut self, power: Power) {
        if power == Power::Failed {
            self.reset = Some(Reset::Power);
        }
    }
}

impl<O: Outside> Chip for Stm32g4<O> {
    const FLASH: (u32, usize) = (0x0800_0000, 512 << 10);
    const SLOTS: (u32, usize) = (0x0807_f000, SLOTS);
    const RAM: (u32, usize) = (0x2000_0000, 96 << 10);
    const ALIASED_RAM: usize = 0;
    const REGISTERS: &'static str = include_str!("../registers/stm32g474.txt");

    fn reset(&mut self, reset: Reset, now: Picoseconds) {
        for (number, port) in self.ports.iter_mut().enumerate() {
            port.reset(gpio_reset(number));
        }
        for pin in (0..7).flat_map(|port| (0..16).map(move |pin| (port, pin))) {
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
        self.adc = Adc::new(AdcLayout::Regulated);
        self.dma = Dma::default();
        self.power = [0; 33];
        // The regulator's range 1 without boost; the internal wake-up line.
        self.power[0] = 0x200;
        self.power[2] = 0x8000;
        self.power[32] = 0x100;
        self.flash.reset(now);
        if matches!(reset, Reset::Power | Reset::BrownOut) {
            self.flash.load_options();
            self.debug = 0;
        }
        self.external_interrupts = [0; 16];
        // The lines that only peripherals raise are not masked.
        self.external_interrupts[0] = 0xff82_0000;
        self.external_interrupts[8] = 0xffff_ff87;
        self.reset = None;
    }

    fn read(&mut self, address: u32, size: u32, now: Picoseconds) -> u32 {
        if let Some(AliasedBit { word, bit }) = bit_band(address) {
            return self.load(word, 4, now) >> bit & 1;
        }
        let word = match address.checked_sub(Self::SLOTS.0) {
            Some(offset) if offset < Self::SLOTS.1 as u32 => self.flash.load(offset, now),
            _ => self.load(address & !3, size, now),
        };
        let value = word >> (8 * (address & 3));
        match size {
            1 => value & 0xff,
            2 => value & 0xffff,
            _ => value,
        }
    }

    fn write(&mut self, address: u32, size: u32, value: u32, now: Picoseconds) {
        if let Some(offset) = address.checked_sub(Self::SLOTS.0)
            && offset < Self::SLOTS.1 as u32
        {
            let power = self.flash.store(offset, value, size, now);
            return self.note_power(power);
        }
        assert!(bit_band(address).is_none(), "store to {address:#010x}");
        self.store(address, value, size, now);
    }

    fn advance(&mut self, now: Picoseconds, memory: &Processor) {
        if self.rcc.advance(now) {
            self.check_clock();
        }
        let hz = self.rcc.bus_hz();
        self.timer.advance(hz, now);
        for bus in 0..2 {
            while let Some(transfer) = self.spis[bus].ended(now) {
                check_spi_pins(&self.ports[1], bus, transfer.hz);
                let received = self.outside.transfer(bus, transfer, now);
                self.spis[bus].complete(received, hz);
            }
        }
        loop {
            self.usart.advance(hz, now);
            if self.usart.wants_reading() && self.dma.serves(RECEIVED) {
                check_function(&self.ports[0], USART_PINS, USART_FUNCTION);
                let byte = self.usart.take();
                self.dma.store_byte(RECEIVED, byte, memory);
            }
            if self.usart.wants_writing()
                && let Some(byte) = self.dma.load_byte(TO_SEND, memory)
            {
                check_function(&self.ports[0], USART_PINS, USART_FUNCTION);
                self.usart.bring(byte, hz, now);
            }
            if self.usart.next_event() > now {
                break;
            }
        }
        let expired = expired(&self.watchdog, &self.window_watchdog, now);
        self.reset = expired.or(self.reset);
    }

    fn next_event(&self) -> Picoseconds {
        let sends = self.usart.wants_writing() && self.dma.serves(TO_SEND);
        let spis = self.spis[0].next_event().min(self.spis[1].next_event());
        self.next_tick()
            .min(spis)
            .min(self.rcc.next_event())
            .min(self.usart.next_event())
            .min(self.watchdog.expires())
            .min(self.window_watchdog.expires())
            .min(if sends { 0 } else { Picoseconds::MAX })
    }

    fn ram_is_at_zero(&self) -> bool {
        false
    }

    fn interrupt_lines(&self) -> u128 {
        let lines = &self.external_interrupts;
        let supply = lines[5] & lines[0] & 1 << 16 != 0;
        u128::from(self.timer.interrupts()) << TIM2
            | u128::from(self.usart.interrupts()) << USART2
            | u128::from(supply) << PVD
            | u128::from(self.spis[0].interrupts()) << SPIS[0]
            | u128::from(self.spis[1].interrupts()) << SPIS[1]
    }

    fn take_nmi(&mut self) -> bool {
        self.flash.take_nmi() || self.rcc.nmi
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

impl<O: Outside> WiredChip for Stm32g4<O> {
    type Outside = O;

    const OSCILLATOR_HZ: [u64; 3] = [29_500, 32_000, 34_000];

    fn without_power(outside: O, oscillator_hz: u64) -> Self {
        Self {
            outside,
            rcc: Rcc::new(),
            ports: std::array::from_fn(|port| Gpio::new(gpio_reset(port))),
            spis: Default::default(),
            usart: Usart::new(UsartLayout::SeparateData),
            timer: Timer::default(),
            watchdog: Watchdog::new(oscillator_hz),
            window_watchdog: WindowWatchdog::new(11, 3),
            dac: Dac::default(),
            adc: Adc::new(AdcLayout::Regulated),
            individual: Individual {
                identification: 0x2003_6469,
                flash_kib: 512,
                unique: [0x0032_0021, 0x3431_510c, 0x3837_3830],
            },
            dma: Dma::default(),
            power: [0; 33],
            supply_mv: 3300,
            flash: Flash::new(),
            external_interrupts: [0; 16],
            debug: 0,
            reset: None,
        }
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
        self.dac.modes & 0x0007_0007 != 0x0002_0002
    }

    fn dac_writes(&self) -> u64 {
        self.dac.writes
    }

    fn set_supply(&mut self, millivolts: u32) {
        let was_low = self.supply_is_low();
        self.supply_mv = millivolts;
        let threshold = [1700, 2000, 2200, 2500, 2800][self.flash.brown_out_level().min(4)];
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
        &mut self.flash.slots
    }

    fn set_new_options(&mut self) {
        self.flash.set_new_options();
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
        self.flash.flip_options(bits);
    }

    fn usart(&self) -> &Usart {
        &self.usart
    }

    fn usart_mut(&mut self) -> &mut Usart {
        &mut self.usart
    }

    fn next_tick(&self) -> Picoseconds {
        self.timer.next_event(self.rcc.bus_hz())
    }
}

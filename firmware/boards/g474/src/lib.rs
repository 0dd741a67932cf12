//! The board NUCLEO-G474RE: an STM32G474 with a crystal of 24 MHz, at 170 MHz.
//!
//! | pin        | function                                                 |
//! |------------|----------------------------------------------------------|
//! | PA4, PA5   | torque u1, u2: DAC1, 1.65 V is zero                      |
//! | PB0        | torque stages enabled (high)                             |
//! | PA2, PA3   | USART2 to and from the host, through the board's debug probe, 921,600 baud |
//! | PB3, PB4, PB5 | SPI1 clock, in, out: encoders                         |
//! | PB6, PB7   | select encoder θ1, elbow (low)                           |
//! | PB10, PB11 | select second encoder θ1, elbow (low)                    |
//! | PB13, PB14, PB15 | SPI2 clock, in, out: force cell                    |
//! | PB12, PB1  | select force cell, second force cell (low)               |
//! | PC0, PC1   | enable, reset (high; pulled down)                        |
//! | PC2        | both torque stages are ready (high; pulled down)         |
//!
//! Except for the serial port these are the pins of the board F405. The control timer is TIM2, the stopwatch is
//! the cycle counter.

#![no_std]
#![cfg(target_os = "none")]

pub mod safety;

use defmt_rtt as _;
use painleve_drivers::encoders::{self, EncoderDriver};
use painleve_drivers::force_cell::{self, ForceCellDriver};
use painleve_drivers::front_end::InputLevels;
use painleve_drivers::stages::NO_TORQUE;
use painleve_image::arm_drive::{ArmDrive, ArmPins};
use painleve_image::board::{Board, Parts, StartFault};
use painleve_image::dma_serial::{self, BAUD, DmaPort};
use painleve_image::flash::{ConfigurationFlash, FlashRegisters};
use painleve_image::memory::FlashMemory;
use painleve_image::probe::{SYSTICK, SpareBits};
use painleve_image::protection::{self, Access, Region};
use painleve_image::sensor_bus::{BusTiming, SensorBus};
use painleve_image::watchdogs::{IndependentWatchdog, Watchdogs};
use painleve_shared::black_box::ResetCause;
use painleve_shared::message::RefusedRate;
use painleve_stm32g4::clock::{self, CORE_HZ};
use painleve_stm32g4::flash;
pub use painleve_stm32g4::pac;
use painleve_stm32g4::pins::{Input, Output, Pins, Port};
use painleve_stm32g4::spi::{SampledAt, SpiPort, Word};
use painleve_stm32g4::usart2::Usart2Dma;
use painleve_stm32g4::watchdogs::{Independent, Window};
use painleve_stm32g4::{supply, timer};

/// Crystal, MHz.
const CRYSTAL_MHZ: u8 = 24;

/// Watchdog timeout while starting, s.
const START_LIMIT_S: f32 = 0.5;

/// Functions of pins (DS12288, alternate functions).
const SPI: u32 = 5;
const USART: u32 = 7;

/// Dividers of the buses, 2^(n + 1): 5.3 MHz, below the encoders' 10 MHz; 1.3 MHz, below the force cell's
/// 2.1 MHz.
const ENCODER_DIVIDER: u8 = 4;
const FORCE_DIVIDER: u8 = 6;

/// What the memory may be used for (`memory.x`).
const REGIONS: [Region; 4] = [
    Region {
        start: 0x2000_0000,
        length: 128 << 10,
        without: 0,
        access: Access::ReadWrite,
    },
    // Below the RAM, for a stack that overflows.
    Region {
        start: 0x1fff_8000,
        length: 32 << 10,
        without: 0,
        access: Access::None,
    },
    // The flash, and in it the slots for configurations.
    Region {
        start: 0x0800_0000,
        length: 512 << 10,
        without: 0,
        access: Access::ReadExecute,
    },
    Region {
        start: flash::Registers::START,
        length: 4 << 10,
        without: 0,
        access: Access::ReadWrite,
    },
];

/// Bits on which no torque depends while the stages are off (RM0440).
const SPARE: [SpareBits; 13] = [
    // Clock of the analog-to-digital converters, and the first two of them.
    SpareBits::of_word(0x4002_104c, 1 << 13),
    SpareBits {
        first: 0x5000_0000,
        last: 0x5000_030c,
        mask: u32::MAX,
    },
    // The codes of the torque stages, until the next answer.
    SpareBits::of_word(0x5000_0820, 0x0fff_0fff),
    // Mode and function of PA0; mode, pull and level of PC6 to PC11.
    SpareBits::of_word(0x4800_0000, 3),
    SpareBits::of_word(0x4800_0020, 15),
    SpareBits::of_word(0x4800_0800, 0x00ff_f000),
    SpareBits::of_word(0x4800_080c, 0x00ff_f000),
    SpareBits::of_word(0x4800_0814, 0x0fc0),
    // The control timer: on and off, and its captures.
    SpareBits::of_word(0x4000_0000, 1),
    SpareBits {
        first: 0x4000_0018,
        last: 0x4000_0020,
        mask: u32::MAX,
    },
    // The window watchdog's counter, and the key that feeds the independent one.
    SpareBits::of_word(0x4000_2c00, 0x7f),
    SpareBits::of_word(0x4000_3000, 0xffff),
    SYSTICK,
];

/// Declares the image for this board with these laws.
#[macro_export]
macro_rules! image {
    ($laws:ty) => {
        ::painleve_image::tasks! {
            board = $crate::G474, laws = $laws, device = $crate::pac,
            control = TIM2, update = TIM3, serial = USART2, link = SPI3,
            sensors = [encoders(0): SPI1, force_cell(1): SPI2]
        }
    };
}

/// The board; see the crate's page.
pub struct G474;

impl Board for G474 {
    type Device = pac::Peripherals;
    type Drive = ArmDrive<G474Pins>;
    type Serial = Usart2Dma;
    type Port = DmaPort<Usart2Dma>;
    type Flash = ConfigurationFlash<flash::Registers>;

    const NAME: &'static str = "NUCLEO-G474RE";

    fn start(
        device: pac::Peripherals,
        mut core: cortex_m::Peripherals,
    ) -> Result<Parts<Self>, StartFault> {
        let watchdog = Independent(device.IWDG);
        watchdog.start(START_LIMIT_S, || ());
        protection::start(&core.MPU, &REGIONS);
        let rcc = device.RCC;
        clock::start(&rcc, &device.PWR, &device.FLASH, CRYSTAL_MHZ)
            .map_err(|_| StartFault::Clock)?;
        let (power, lines) = (&device.PWR, &device.EXTI);
        supply::watch(power, lines, &device.FLASH, &mut core.NVIC, &watchdog)?;
        supply::stop_dead_battery_detection(&device.PWR);
        start_clocks(&rcc);

        let mut pins = Pins::new(device.GPIOA, device.GPIOB, device.GPIOC, &rcc);
        let enable = pins.output(Port::B, 0, false);
        pins.analog(Port::A, 4);
        pins.analog(Port::A, 5);
        start_converter(&device.DAC1);

        pins.alternate(Port::A, 2, USART);
        pins.alternate(Port::A, 3, USART);
        let usart = Usart2Dma::new(device.USART2, device.DMA1, &device.DMAMUX, CORE_HZ, BAUD);
        let (bytes, port) = dma_serial::split(usart).ok_or(StartFault::Link)?;

        core.DCB.enable_trace();
        core.DWT.enable_cycle_counter();
        for number in [3, 4, 5, 13, 14, 15] {
            pins.alternate(Port::B, number, SPI);
        }
        let word = Word::HalfWord;
        let spi = SpiPort::new(device.SPI1, word, SampledAt::SecondEdge, ENCODER_DIVIDER);
        let selects = [6, 7, 10, 11].map(|number| pins.output(Port::B, number, true));
        let timing = timing(word, ENCODER_DIVIDER);
        let encoders = SensorBus::new(spi, selects, EncoderDriver::new(), timing);
        let word = Word::Byte;
        let spi = SpiPort::new(device.SPI2, word, SampledAt::FirstEdge, FORCE_DIVIDER);
        let selects = [12, 1].map(|number| pins.output(Port::B, number, true));
        let timing = self::timing(word, FORCE_DIVIDER);
        let force_cell = SensorBus::new(spi, selects, ForceCellDriver::new(), timing);

        let pins = G474Pins {
            timer: device.TIM2,
            watchdogs: Watchdogs::new(watchdog, Window(device.WWDG), CORE_HZ),
            converter: device.DAC1,
            enable,
            enable_switch: pins.pulled_down_input(Port::C, 0),
            reset_button: pins.pulled_down_input(Port::C, 1),
            stages_ready: pins.pulled_down_input(Port::C, 2),
        };
        let drive = ArmDrive::new(pins, encoders, force_cell);
        let memory = FlashMemory::new(ConfigurationFlash::new(flash::Registers(device.FLASH)));
        Ok(Parts {
            drive,
            bytes,
            port,
            memory,
        })
    }

    fn reset_cause() -> ResetCause {
        clock::reset_cause()
    }

    fn take_memory_fault() -> bool {
        flash::take_fault()
    }

    fn take_torque_off() {
        safety::take_torque_off();
    }

    /// Waits until the watchdog resets the chip, which then waits for a configuration with the torque off.
    fn halt() -> ! {
        Self::take_torque_off();
        loop {
            cortex_m::asm::nop();
        }
    }

    fn idle() {
        clock::sleep();
    }
}

/// Switches the clocks of all peripherals in use on, except those of pins and power control.
fn start_clocks(rcc: &pac::RCC) {
    rcc.ahb1enr()
        .modify(|_, w| w.dma1en().set_bit().dmamux1en().set_bit());
    rcc.ahb2enr().modify(|_, w| w.dac1en().set_bit());
    rcc.apb1enr1().modify(|_, w| {
        w.tim2en().set_bit().wwdgen().set_bit();
        w.spi2en().set_bit().usart2en().set_bit()
    });
    rcc.apb2enr().modify(|_, w| w.spi1en().set_bit());
    // A peripheral can be used two cycles after its clock has come.
    let _ = rcc.apb2enr().read();
}

const fn bus_hz(divider: u8) -> u32 {
    CORE_HZ >> (divider + 1)
}

const _: () = assert!(bus_hz(ENCODER_DIVIDER) <= encoders::FASTEST_HZ);
const _: () = assert!(bus_hz(FORCE_DIVIDER) <= force_cell::FASTEST_HZ);

fn timing(word: Word, divider: u8) -> BusTiming {
    BusTiming {
        core_hz: CORE_HZ,
        bus_hz: bus_hz(divider),
        word_bits: word.bits(),
    }
}

/// Starts both channels at zero torque and without the output buffer, which would cut the range by 0.2 V at
/// either end (RM0440, DAC_MCR, mode 2).
fn start_converter(converter: &pac::DAC1) {
    put_out(converter, [NO_TORQUE; 2]);
    converter.mcr().write(|w| {
        w.mode1().normal_pin_no_buffer();
        w.mode2().normal_pin_no_buffer();
        w.hfsel().more160mhz()
    });
    converter
        .cr()
        .modify(|_, w| w.en1().set_bit().en2().set_bit());
}

/// Writes both codes in one store, so that the stages change together.
fn put_out(converter: &pac::DAC1, [code_1, code_2]: [u16; 2]) {
    converter
        .dhr12rd()
        .write(|w| w.dacc1dhr().set(code_1).dacc2dhr().set(code_2));
}

/// Control timer, watchdogs, torque stages and switches of the board.
pub struct G474Pins {
    timer: pac::TIM2,
    watchdogs: Watchdogs<Independent, Window>,
    converter: pac::DAC1,
    enable: Output,
    enable_switch: Input,
    reset_button: Input,
    stages_ready: Input,
}

impl ArmPins for G474Pins {
    type EncoderSpi = SpiPort<pac::SPI1>;
    type ForceSpi = SpiPort<pac::SPI2>;
    type Select = Output;

    const SPARE: &'static [SpareBits] = &SPARE;

    fn check_rate(&self, tick_hz: f32, drives: bool) -> Result<(), RefusedRate> {
        self.watchdogs.check_rate(tick_hz, drives)
    }

    fn start_timer(&mut self, tick_hz: f32) {
        // First, as it takes longer than a period of a fast timer.
        self.watchdogs.set_period(1.0 / tick_hz);
        timer::restart(&self.timer, CORE_HZ as f32 / tick_hz);
    }

    fn begin_tick(&mut self) {
        timer::acknowledge(&self.timer);
        self.watchdogs.feed();
    }

    fn next_tick_is_due(&self) -> bool {
        timer::is_due(&self.timer)
    }

    fn levels(&self) -> InputLevels {
        InputLevels {
            enable: self.enable_switch.is_high(),
            reset: self.reset_button.is_high(),
            stages_ready: self.stages_ready.is_high(),
        }
    }

    fn switch_stages_on(&mut self, codes: [u16; 2]) {
        put_out(&self.converter, codes);
        self.enable.set(true);
    }

    fn switch_stages_off(&mut self) {
        self.enable.set(false);
        put_out(&self.converter, [NO_TORQUE; 2]);
    }

    fn stopwatch_hz(&self) -> u32 {
        CORE_HZ
    }
}

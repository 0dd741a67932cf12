//! The flash target: an STM32F405 with an 8 MHz crystal, at 168 MHz.
//!
//! | pin        | function                                                 |
//! |------------|----------------------------------------------------------|
//! | PA4, PA5   | torque u1, u2: DAC, 1.65 V is zero                       |
//! | PB0        | torque stages enabled (high)                             |
//! | PA9, PA10  | USART1 to and from the host, 921,600 baud                |
//! | PB3, PB4, PB5 | SPI1 clock, in, out: encoders                         |
//! | PB6, PB7   | select encoder θ1, elbow (low)                           |
//! | PB10, PB11 | select second encoder θ1, elbow (low)                    |
//! | PB13, PB14, PB15 | SPI2 clock, in, out: force cell                    |
//! | PB12, PB1  | select force cell, second force cell (low)               |
//! | PC0, PC1   | enable, reset (high; pulled down)                        |
//! | PC2        | both torque stages are ready (high; pulled down)          |
//!
//! The control timer is TIM2, the stopwatch is the cycle counter.

#![no_std]
#![cfg(target_os = "none")]

pub mod emulator;
pub mod program_memory;
pub mod safety;

use core::sync::atomic::{AtomicU32, Ordering};

use defmt_rtt as _;
use painleve_drivers::encoders::{self, EncoderDriver};
use painleve_drivers::force_cell::{self, ForceCellDriver};
use painleve_drivers::front_end::InputLevels;
use painleve_drivers::stages::NO_TORQUE;
use painleve_image::arm_drive::{ArmDrive, ArmPins};
use painleve_image::board::{Board, Parts, StartFault};
use painleve_image::dma_serial::{self, BAUD};
use painleve_image::flash::{ConfigurationFlash, FlashRegisters};
use painleve_image::memory::FlashMemory;
use painleve_image::probe::{SYSTICK, SpareBits};
use painleve_image::protection::{self, Access, Region};
use painleve_image::sensor_bus::{BusTiming, SensorBus};
use painleve_image::watchdogs::{IndependentWatchdog, Watchdogs};
use painleve_shared::black_box::ResetCause;
use painleve_shared::message::RefusedRate;
use painleve_stm32f4::spi::SpiPort;
use painleve_stm32f4::uart_dma::UartDma;
use painleve_stm32f4::watchdogs::{Independent, Window};
use painleve_stm32f4::{clock, flash, supply, timer};
use stm32f4xx_hal::gpio::{ErasedPin, Input, Output, PB0, PC0, PC1, PC2, PinState, Speed};
pub use stm32f4xx_hal::pac;
use stm32f4xx_hal::pac::{SPI1, SPI2};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::{Config, Enable, Rcc};
use stm32f4xx_hal::serial::{Serial, config};
use stm32f4xx_hal::spi::{Mode, Phase, Polarity, Spi};

use crate::emulator::Link;

/// Crystal, MHz.
const CRYSTAL_MHZ: u32 = 8;

/// Number of polls for a crystal that does not start: some 100 ms at the internal 16 MHz; a crystal needs 2 ms, but the data
/// sheet names no longest time.
const CRYSTAL_PATIENCE: u32 = 240_000;

/// Watchdog timeout while starting; it also bounds the wait for the phase-locked loop.
const START_LIMIT_S: f32 = 0.5;

/// Below the encoders' 10 MHz and the force cell's 2.1 MHz, at rates into which the buses' clocks can be
/// divided.
const ENCODER_BUS_HZ: u32 = 5_250_000;
const FORCE_BUS_HZ: u32 = 1_312_500;
const _: () = assert!(ENCODER_BUS_HZ <= encoders::FASTEST_HZ);
const _: () = assert!(FORCE_BUS_HZ <= force_cell::FASTEST_HZ);

/// What the memory may be used for (`memory.x`).
const REGIONS: [Region; 5] = [
    // SRAM1 with the program, through its alias at 0 and as data, without SRAM2.
    Region {
        start: 0,
        length: 128 << 10,
        without: 0x80,
        access: Access::ReadExecute,
    },
    Region {
        start: 0x2000_0000,
        length: 128 << 10,
        without: 0x80,
        access: Access::Read,
    },
    Region {
        start: 0x2001_c000,
        length: 16 << 10,
        without: 0,
        access: Access::ReadWrite,
    },
    // The flash, and in it the slots for configurations.
    Region {
        start: 0x0800_0000,
        length: 1 << 20,
        without: 0,
        access: Access::ReadExecute,
    },
    Region {
        start: flash::Registers::START,
        length: 256 << 10,
        without: 0,
        access: Access::ReadWrite,
    },
];

/// Bits on which no torque depends while the stages are off (RM0090).
const SPARE: [SpareBits; 13] = [
    // Clock of the first analog-to-digital converter, and the converters.
    SpareBits::of_word(0x4002_3844, 1 << 8),
    SpareBits {
        first: 0x4001_2000,
        last: 0x4001_2308,
        mask: u32::MAX,
    },
    // The codes of the torque stages, until the next answer.
    SpareBits::of_word(0x4000_7420, 0x0fff_0fff),
    // Mode and function of PA0; mode, pull and level of PC6 to PC11.
    SpareBits::of_word(0x4002_0000, 3),
    SpareBits::of_word(0x4002_0020, 15),
    SpareBits::of_word(0x4002_0800, 0x00ff_f000),
    SpareBits::of_word(0x4002_080c, 0x00ff_f000),
    SpareBits::of_word(0x4002_0814, 0x0fc0),
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
            board = $crate::F405, laws = $laws, device = $crate::pac,
            control = TIM2, update = TIM3, serial = USART1, link = SPI3,
            sensors = [encoders(0): SPI1, force_cell(1): SPI2]
        }
    };
}

/// The board; see the crate's page.
pub struct F405;

impl Board for F405 {
    type Device = pac::Peripherals;
    type Drive = ArmDrive<F405Pins>;
    type Serial = UartDma;
    type Port = Link;
    type Flash = ConfigurationFlash<flash::Registers>;

    const NAME: &'static str = "STM32F405";

    fn start(
        device: pac::Peripherals,
        mut core: cortex_m::Peripherals,
    ) -> Result<Parts<Self>, StartFault> {
        let watchdog = Independent(device.IWDG);
        watchdog.start(START_LIMIT_S, || ());
        protection::start(&core.MPU, &REGIONS);
        let is_emulated = emulator::is_here();
        let mut rcc = start_clocks(device.RCC, is_emulated)?;
        pac::PWR::enable(&mut rcc);
        let (power, lines) = (&device.PWR, &device.EXTI);
        supply::watch(power, lines, &device.FLASH, &mut core.NVIC, &watchdog)?;

        let a = device.GPIOA.split(&mut rcc);
        let b = device.GPIOB.split(&mut rcc);
        let c = device.GPIOC.split(&mut rcc);

        let enable = b.pb0.into_push_pull_output_in_state(PinState::Low);
        let _ = (a.pa4.into_analog(), a.pa5.into_analog());
        pac::DAC::enable(&mut rcc);
        start_converter(&device.DAC);

        let line = config::Config::default().baudrate(BAUD.bps());
        let serial = Serial::new(device.USART1, (a.pa9, a.pa10), line, &mut rcc);
        let serial: Serial<pac::USART1> = serial.map_err(|_| StartFault::Link)?;
        let (usart, _) = serial.release();
        pac::DMA2::enable(&mut rcc);
        let uart = UartDma::new(usart, device.DMA2);
        let (bytes, port) = dma_serial::split(uart).ok_or(StartFault::Link)?;

        let mode_0 = Mode {
            polarity: Polarity::IdleLow,
            phase: Phase::CaptureOnFirstTransition,
        };
        let mode_1 = Mode {
            polarity: Polarity::IdleLow,
            phase: Phase::CaptureOnSecondTransition,
        };
        // At reset, two of these pins belong to the debugger, which uses them only for JTAG. With a slow clock pin the
        // last bit of a word may be received wrongly (ES0182, delayed SCK feedback). The encoders' bits come faster than an
        // output changes at low speed (2 MHz).
        let fastest = Speed::VeryHigh;
        let pins = (
            Some(b.pb3.into_alternate::<5>().speed(fastest)),
            Some(b.pb4.into_alternate::<5>()),
            Some(b.pb5.into_alternate::<5>().speed(fastest)),
        );
        let core_hz = rcc.clocks.sysclk().raw();
        let spi = Spi::new(device.SPI1, pins, mode_1, ENCODER_BUS_HZ.Hz(), &mut rcc);
        let (spi, _) = spi.frame_size_16bit().release();
        let high = PinState::High;
        let selects = [
            b.pb6.into_push_pull_output_in_state(high).erase(),
            b.pb7.into_push_pull_output_in_state(high).erase(),
            b.pb10.into_push_pull_output_in_state(high).erase(),
            b.pb11.into_push_pull_output_in_state(high).erase(),
        ];
        let timing = BusTiming {
            core_hz,
            bus_hz: ENCODER_BUS_HZ,
            word_bits: 16,
        };
        let encoders = SensorBus::new(SpiPort(spi), selects, EncoderDriver::new(), timing);
        let clock = b.pb13.into_alternate::<5>().speed(fastest);
        let pins = (Some(clock), Some(b.pb14), Some(b.pb15));
        let spi = Spi::new(device.SPI2, pins, mode_0, FORCE_BUS_HZ.Hz(), &mut rcc);
        let (spi, _) = spi.release();
        let selects = [
            b.pb12.into_push_pull_output_in_state(high).erase(),
            b.pb1.into_push_pull_output_in_state(high).erase(),
        ];
        let timing = BusTiming {
            core_hz,
            bus_hz: FORCE_BUS_HZ,
            word_bits: 8,
        };
        let force_cell = SensorBus::new(SpiPort(spi), selects, ForceCellDriver::new(), timing);

        pac::TIM2::enable(&mut rcc);
        rcc.apb1enr().modify(|_, w| w.wwdgen().set_bit());
        core.DCB.enable_trace();
        core.DWT.enable_cycle_counter();
        let slow_bus_hz = rcc.clocks.pclk1().raw();
        let timer_hz = rcc.clocks.timclk1().raw();
        let [timer_hz, stopwatch_hz] = emulator::clocks(is_emulated, [timer_hz, core_hz]);
        let pins = F405Pins {
            timer_hz: timer_hz as f32,
            stopwatch_hz,
            stopwatch: emulator::stopwatch(is_emulated, device.TIM5),
            timer: device.TIM2,
            watchdogs: Watchdogs::new(watchdog, Window(device.WWDG), slow_bus_hz),
            converter: device.DAC,
            enable,
            enable_switch: c.pc0.into_pull_down_input(),
            reset_button: c.pc1.into_pull_down_input(),
            stages_ready: c.pc2.into_pull_down_input(),
        };
        let drive = ArmDrive::new(pins, encoders, force_cell);
        let memory = FlashMemory::new(ConfigurationFlash::new(flash::Registers(device.FLASH)));
        Ok(Parts {
            drive,
            bytes,
            port: Link::new(port, is_emulated),
            memory,
        })
    }

    fn reset_cause() -> ResetCause {
        clock::reset_cause()
    }

    fn take_torque_off() {
        safety::take_torque_off();
    }

    /// Waits until the watchdog resets the chip, which then waits for a configuration with the torque off.
    fn halt() -> ! {
        Self::take_torque_off();
        emulator::end();
        loop {
            cortex_m::asm::nop();
        }
    }

    fn idle() {
        clock::sleep();
    }
}

/// Starts the clocks, unless an emulator has none.
// Out of line, and so is what else depends on the emulator: branches would make `start` take more of the stack, which
// remains taken as long as the tasks run.
#[inline(never)]
fn start_clocks(rcc: pac::RCC, is_emulated: bool) -> Result<Rcc, StartFault> {
    if is_emulated {
        return Ok(rcc.constrain());
    }
    start_crystal(&rcc)?;
    let clocks = Config::hse(CRYSTAL_MHZ.MHz()).sysclk(168.MHz());
    let rcc = rcc.freeze(clocks);
    clock::watch_crystal(&rcc);
    Ok(rcc)
}

/// Starts the crystal oscillator, or gives up after a bounded wait.
fn start_crystal(rcc: &pac::RCC) -> Result<(), StartFault> {
    rcc.cr().modify(|_, w| w.hseon().set_bit());
    let settled = (0..CRYSTAL_PATIENCE).any(|_| rcc.cr().read().hserdy().bit_is_set());
    if settled {
        Ok(())
    } else {
        Err(StartFault::Clock)
    }
}

/// Starts both channels at zero torque and without the output buffer, which would cut the range by 0.2 V at
/// either end.
fn start_converter(converter: &pac::DAC) {
    put_out(converter, [NO_TORQUE; 2]);
    converter.cr().modify(|_, w| {
        w.boff1().set_bit().boff2().set_bit();
        w.en1().set_bit().en2().set_bit()
    });
}

/// Writes both codes in one store, so that the stages change together.
fn put_out(converter: &pac::DAC, [code_1, code_2]: [u16; 2]) {
    converter
        .dhr12rd()
        .write(|w| w.dacc1dhr().set(code_1).dacc2dhr().set(code_2));
}

/// Control timer, watchdogs, torque stages and switches of the board.
pub struct F405Pins {
    timer: pac::TIM2,
    timer_hz: f32,
    stopwatch_hz: u32,
    /// The register of the cycle counter.
    stopwatch: &'static AtomicU32,
    watchdogs: Watchdogs<Independent, Window>,
    converter: pac::DAC,
    enable: PB0<Output>,
    enable_switch: PC0<Input>,
    reset_button: PC1<Input>,
    stages_ready: PC2<Input>,
}

impl ArmPins for F405Pins {
    type EncoderSpi = SpiPort<SPI1>;
    type ForceSpi = SpiPort<SPI2>;
    type Select = ErasedPin<Output>;

    const SPARE: &'static [SpareBits] = &SPARE;

    fn check_rate(&self, tick_hz: f32, drives: bool) -> Result<(), RefusedRate> {
        self.watchdogs.check_rate(tick_hz, drives)
    }

    fn start_timer(&mut self, tick_hz: f32) {
        // First, as it takes longer than a period of a fast timer.
        self.watchdogs.set_period(1.0 / tick_hz);
        timer::start(&self.timer, self.timer_hz / tick_hz);
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
        self.enable.set_high();
    }

    fn switch_stages_off(&mut self) {
        self.enable.set_low();
        put_out(&self.converter, [NO_TORQUE; 2]);
    }

    fn stopwatch(&self) -> u32 {
        self.stopwatch.load(Ordering::Relaxed)
    }

    fn stopwatch_hz(&self) -> u32 {
        self.stopwatch_hz
    }
}

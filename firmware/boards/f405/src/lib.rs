//! The flash target: an STM32F405 with an 8 MHz crystal, at 168 MHz.
//!
//! | pin        | function                                                 |
//! |------------|----------------------------------------------------------|
//! | PA4, PA5   | torque u1, u2: DAC, 1.65 V is zero                       |
//! | PB0        | torque stages enabled (high)                             |
//! | PA9, PA10  | USART1 to and from the host, 921,600 baud                |
//! | PB3, PB4, PB5 | SPI1 clock, in, out: encoders                         |
//! | PB6, PB7   | select encoder θ1, elbow (low)                           |
//! | PB13, PB14, PB15 | SPI2 clock, in, out: force cell                    |
//! | PB12       | select force cell (low)                                  |
//! | PC0, PC1   | enable, reset (high; pulled down)                        |
//! | PC2        | both torque stages are ready (high; pulled down)          |
//!
//! The control timer is TIM2, the stopwatch is the cycle counter. The control timer runs from the start,
//! first at [`IDLE_HZ`], so that only finished control ticks feed the watchdogs.
//!
//! The sensors' buses are read by interrupts, for the next tick: readings are one tick old, which is the delay
//! from sample to torque that scenarios simulate (`converters.torque.delay_ticks`).
//!
//! The torque stages are on only with the real plant: with frames from the host they stay off.

#![no_std]
#![cfg(target_os = "none")]

pub mod program_memory;
pub mod safety;
pub mod uart_dma;

use cortex_m::peripheral::DWT;
use defmt_rtt as _;
use painleve_drivers::encoders::EncoderDriver;
use painleve_drivers::force_cell::ForceCellDriver;
use painleve_drivers::front_end::{FrontEnd, FrontEndSettings, InputLevels};
use painleve_firmware::Configuration;
use painleve_firmware::drive::Drive;
use painleve_firmware::law::Law;
use painleve_image::board::{Board, BoardDrive, Parts, StartFault};
use painleve_shared::Arm;
use painleve_shared::black_box::ResetCause;
use painleve_shared::counts::TorqueCounts;
use painleve_shared::frame::{ActuatorFrame, SensorFrame};
use painleve_shared::message::FrameSource;
use painleve_shared::status::SupervisorState;
use painleve_stm32f4::sensor_bus::{BusTiming, SensorBus};
use painleve_stm32f4::timer;
use stm32f4xx_hal::gpio::{ErasedPin, Input, Output, PinState};
pub use stm32f4xx_hal::pac;
use stm32f4xx_hal::pac::{SPI1, SPI2};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::{Config, Enable};
use stm32f4xx_hal::serial::{Serial, config};
use stm32f4xx_hal::spi::{Mode, Phase, Polarity, Spi};

use crate::safety::Watchdogs;
use crate::uart_dma::{DmaBytes, DmaPort};

/// Crystal, MHz.
const CRYSTAL_MHZ: u32 = 8;

/// Number of polls for a crystal that does not start: some 10 ms at the internal 16 MHz; a crystal needs
/// about 2 ms.
const CRYSTAL_PATIENCE: u32 = 20_000;

/// Watchdog timeout while starting; it also bounds the wait for the phase-locked loop.
const START_LIMIT_S: f32 = 0.5;

/// Control rate while there is no configuration.
const IDLE_HZ: f32 = 1000.0;

/// DAC code for zero torque; the converter has 12 bits.
pub const NO_TORQUE: u16 = 1 << 11;

/// Bits of the DAC.
const DAC_BITS: u8 = 12;

/// Below the encoders' 10 MHz and the force cell's 2.1 MHz, at rates into which the buses' clocks can be
/// divided.
const ENCODER_BUS_HZ: u32 = 5_250_000;
const FORCE_BUS_HZ: u32 = 1_312_500;

/// Declares the image for this board with these laws.
#[macro_export]
macro_rules! image {
    ($laws:ty) => {
        ::painleve_image::tasks! {
            board = $crate::F405, laws = $laws, device = $crate::pac,
            control = TIM2, serial = USART1, link = SPI3,
            sensors = [encoders(0): SPI1, force_cell(1): SPI2]
        }
    };
}

/// The board; see the crate's page.
pub struct F405;

impl Board for F405 {
    type Device = pac::Peripherals;
    type Drive = F405Drive;
    type Bytes = DmaBytes;
    type Port = DmaPort;

    const NAME: &'static str = "STM32F405";

    fn start(
        device: pac::Peripherals,
        mut core: cortex_m::Peripherals,
    ) -> Result<Parts<Self>, StartFault> {
        Watchdogs::start_independent(&device.IWDG, START_LIMIT_S);
        start_crystal(&device.RCC)?;
        let clocks = Config::hse(CRYSTAL_MHZ.MHz()).sysclk(168.MHz());
        let mut rcc = device.RCC.freeze(clocks);
        safety::watch_crystal(&rcc);
        pac::PWR::enable(&mut rcc);
        safety::watch_supply(&device.PWR, &device.EXTI, &device.FLASH, &mut core.NVIC);

        let a = device.GPIOA.split(&mut rcc);
        let b = device.GPIOB.split(&mut rcc);
        let c = device.GPIOC.split(&mut rcc);

        let enable = b.pb0.into_push_pull_output_in_state(PinState::Low).erase();
        let _ = (a.pa4.into_analog(), a.pa5.into_analog());
        pac::DAC::enable(&mut rcc);
        start_converter(&device.DAC);

        let line = config::Config::default().baudrate(uart_dma::BAUD.bps());
        let serial = Serial::new(device.USART1, (a.pa9, a.pa10), line, &mut rcc);
        let serial: Serial<pac::USART1> = serial.map_err(|_| StartFault::Link)?;
        let (usart, _) = serial.release();
        pac::DMA2::enable(&mut rcc);
        let (bytes, port) = uart_dma::split(usart, &device.DMA2).ok_or(StartFault::Link)?;

        let mode_0 = Mode {
            polarity: Polarity::IdleLow,
            phase: Phase::CaptureOnFirstTransition,
        };
        let mode_1 = Mode {
            polarity: Polarity::IdleLow,
            phase: Phase::CaptureOnSecondTransition,
        };
        // At reset, two of these pins belong to the debugger, which uses them only for JTAG.
        let pins = (
            Some(b.pb3.into_alternate::<5>()),
            Some(b.pb4.into_alternate::<5>()),
            Some(b.pb5.into_alternate::<5>()),
        );
        let core_hz = rcc.clocks.sysclk().raw();
        let spi = Spi::new(device.SPI1, pins, mode_1, ENCODER_BUS_HZ.Hz(), &mut rcc);
        let (spi, _) = spi.frame_size_16bit().release();
        let selects = [
            b.pb6.into_push_pull_output_in_state(PinState::High).erase(),
            b.pb7.into_push_pull_output_in_state(PinState::High).erase(),
        ];
        let timing = BusTiming {
            core_hz,
            bus_hz: ENCODER_BUS_HZ,
            word_bits: 16,
        };
        let encoders = SensorBus::new(spi, selects, EncoderDriver::new(), timing);
        let pins = (Some(b.pb13), Some(b.pb14), Some(b.pb15));
        let spi = Spi::new(device.SPI2, pins, mode_0, FORCE_BUS_HZ.Hz(), &mut rcc);
        let (spi, _) = spi.release();
        let select = b
            .pb12
            .into_push_pull_output_in_state(PinState::High)
            .erase();
        let timing = BusTiming {
            core_hz,
            bus_hz: FORCE_BUS_HZ,
            word_bits: 8,
        };
        let force_cell = SensorBus::new(spi, [select], ForceCellDriver::new(), timing);

        pac::TIM2::enable(&mut rcc);
        rcc.apb1enr().modify(|_, w| w.wwdgen().set_bit());
        core.DCB.enable_trace();
        core.DWT.enable_cycle_counter();
        let slow_bus_hz = rcc.clocks.pclk1().raw();
        let mut drive = F405Drive {
            timer_hz: rcc.clocks.timclk1().raw() as f32,
            core_hz,
            timer: device.TIM2,
            watchdogs: Watchdogs::new(device.IWDG, device.WWDG, slow_bus_hz),
            converter: device.DAC,
            enable,
            encoders,
            force_cell,
            enable_switch: c.pc0.into_pull_down_input().erase(),
            reset_button: c.pc1.into_pull_down_input().erase(),
            stages_ready: c.pc2.into_pull_down_input().erase(),
            front_end: FrontEnd::new(None),
            torque_bits: DAC_BITS,
            stage_reversed: [false; 2],
            source: FrameSource::Lockstep,
            from_host: None,
        };
        drive.start_timer(IDLE_HZ);
        Ok(Parts { drive, bytes, port })
    }

    fn reset_cause() -> ResetCause {
        safety::reset_cause()
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
        cortex_m::asm::wfi();
    }
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

/// The control task's part of the board.
pub struct F405Drive {
    timer: pac::TIM2,
    timer_hz: f32,
    core_hz: u32,
    watchdogs: Watchdogs,
    converter: pac::DAC,
    enable: ErasedPin<Output>,
    encoders: SensorBus<SPI1, ErasedPin<Output>, EncoderDriver, 2>,
    force_cell: SensorBus<SPI2, ErasedPin<Output>, ForceCellDriver, 1>,
    enable_switch: ErasedPin<Input>,
    reset_button: ErasedPin<Input>,
    stages_ready: ErasedPin<Input>,
    front_end: FrontEnd,
    /// Resolution of the controller's torques, bits.
    torque_bits: u8,
    /// Whether the torque stages turn their joints backwards.
    stage_reversed: [bool; 2],
    source: FrameSource,
    /// Newest frame from the host, if the host is the source of frames.
    from_host: Option<SensorFrame>,
}

impl F405Drive {
    fn start_timer(&mut self, tick_hz: f32) {
        timer::set_back(&self.timer);
        timer::start(&self.timer, self.timer_hz / tick_hz);
        self.watchdogs.set_period(1.0 / tick_hz);
    }

    /// Returns the readings that were started at the last tick, and starts the next.
    fn read_sensors(&mut self) -> SensorFrame {
        let levels = InputLevels {
            enable: self.enable_switch.is_high(),
            reset: self.reset_button.is_high(),
            stages_ready: self.stages_ready.is_high(),
        };
        let (encoders, force_cell) = (self.encoders.complete(), self.force_cell.complete());
        let frame = self.front_end.frame(encoders, force_cell, levels);
        self.encoders.start();
        self.force_cell.start();
        frame
    }

    /// Returns the DAC's code for a torque: offset binary of 12 bits.
    fn code(&self, torque: TorqueCounts, reversed: bool) -> u16 {
        let counts = if self.torque_bits > DAC_BITS {
            torque.0 >> (self.torque_bits - DAC_BITS)
        } else {
            torque.0 << (DAC_BITS - self.torque_bits)
        };
        let counts = if reversed { -counts } else { counts };
        (counts + i32::from(NO_TORQUE)).clamp(0, (1 << DAC_BITS) - 1) as u16
    }
}

impl Drive for F405Drive {
    fn begin_tick(&mut self) {
        timer::acknowledge(&self.timer);
        // The previous tick is finished, and this one is not too early.
        self.watchdogs.feed();
    }

    fn next_tick_is_due(&self) -> bool {
        timer::is_due(&self.timer)
    }

    fn sample(&mut self) -> Option<SensorFrame> {
        match self.source {
            FrameSource::Lockstep | FrameSource::Realtime => self.from_host.take(),
            _ => Some(self.read_sensors()),
        }
    }

    fn actuate(&mut self, answer: &ActuatorFrame) {
        let is_active = answer
            .supervisor_state()
            .is_some_and(SupervisorState::drives);
        self.front_end.note_active(is_active);
        let is_driven = matches!(
            self.source,
            FrameSource::Sensors | FrameSource::Commissioning
        );
        if is_active && is_driven && self.front_end.is_fit() {
            let [torque_1, torque_2] = answer.torques;
            let [reversed_1, reversed_2] = self.stage_reversed;
            let codes = [
                self.code(torque_1, reversed_1),
                self.code(torque_2, reversed_2),
            ];
            put_out(&self.converter, codes);
            self.enable.set_high();
        } else {
            self.enable.set_low();
            put_out(&self.converter, [NO_TORQUE; 2]);
        }
    }

    fn stopwatch(&self) -> u32 {
        DWT::cycle_count()
    }
}

impl BoardDrive for F405Drive {
    fn start<L: Law>(&mut self, configuration: &Configuration<L>, source: FrameSource) {
        let converters = &configuration.converters;
        self.torque_bits = converters.torque.bits;
        self.stage_reversed = converters.mounting.stage_reversed;
        self.source = source;
        self.from_host = None;
        // The switch has to be opened and closed again, and the sensors are checked anew.
        let is_mounted = source != FrameSource::Commissioning;
        let arm = Arm::new(configuration.arm).ok().filter(|_| is_mounted);
        self.front_end = FrontEnd::new(Some(FrontEndSettings {
            encoders: converters.encoders,
            force: converters.force,
            mounting: converters.mounting,
            arm,
        }));
        self.encoders.restart();
        self.force_cell.restart();
        self.start_timer(configuration.tick_hz);
    }

    fn idle(&mut self) {
        self.start_timer(IDLE_HZ);
    }

    fn offer(&mut self, frame: SensorFrame) {
        self.from_host = Some(frame);
    }

    fn permit_arming(&mut self, permitted: bool) -> bool {
        let is_permitted = permitted && self.source.is_on_board();
        self.front_end.permit_arming(is_permitted);
        is_permitted
    }

    // In line: each interrupt contains its own bus only.
    #[inline(always)]
    fn serve_sensor_bus(&mut self, bus: usize) {
        if bus == 0 {
            self.encoders.serve();
        } else {
            self.force_cell.serve();
        }
    }

    fn stopwatch_hz(&self) -> u32 {
        self.core_hz
    }
}

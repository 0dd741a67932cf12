//! The flash target: a STM32F405 with an 8 MHz crystal, 168 MHz.
//!
//! | pin        | what                                                     |
//! |------------|----------------------------------------------------------|
//! | PA4, PA5   | torque u1, u2: DAC, 1.65 V is none                       |
//! | PB0        | torque stages enabled (high)                             |
//! | PA9, PA10  | USART1 to and from the host, 921,600 baud                |
//! | PB3, PB4, PB5 | SPI1 clock, in, out: encoders                         |
//! | PB6, PB7   | select encoder θ1, elbow (low)                           |
//! | PB13, PB14, PB15 | SPI2 clock, in, out: force cell                    |
//! | PB12       | select force cell (low)                                  |
//! | PC0, PC1   | enable, reset (high; pulled down)                        |
//!
//! The control timer is TIM2, the stopwatch the cycle counter. The watchdog is fed by
//! the control timer's interrupt only. This module compiles, but has not yet run on a board:
//! its serial port and control timer are those that run under QEMU.

use cortex_m::peripheral::DWT;
use defmt_rtt as _;
use embedded_hal_bus::spi::{ExclusiveDevice, NoDelay};
use painleve_firmware::Configuration;
use painleve_shared::counts::TorqueCounts;
use painleve_shared::frame::{ActuatorFrame, DigitalInputs, SensorFrame};
use painleve_shared::message::Plant;
use painleve_shared::status::SupervisorState;
use stm32f4xx_hal::dac::{C1, C2, DacOut, DacPin};
use stm32f4xx_hal::gpio::{ErasedPin, Input, Output, PinState};
use stm32f4xx_hal::pac::{self, SPI1, SPI2};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::{Config, Enable};
use stm32f4xx_hal::serial::{Serial, config};
use stm32f4xx_hal::spi::{Mode, Phase, Polarity, Spi};
use stm32f4xx_hal::watchdog::IndependentWatchdog;

use crate::board::{Board, Drive, Parts, StartFault, timer};
use crate::sensors::{Encoders, ForceCell};
use crate::uart::{self, UartBytes, UartPort};

/// Crystal, MHz.
const CRYSTAL_MHZ: u32 = 8;

/// Looks at a crystal that does not start, some 10 ms at the internal 16 MHz; it needs about 2.
const CRYSTAL_PATIENCE: u32 = 20_000;

/// Watchdog while starting: also bounds the wait for the phase-locked loop.
const START_LIMIT_MS: u32 = 1000;

/// Watchdog once the control timer runs, whose period is at most 100 ms (10 Hz).
const TICK_LIMIT_MS: u32 = 250;

/// DAC code without torque; the converter has 12 bits.
const NO_TORQUE: u16 = 1 << 11;

/// Bits of the DAC.
const DAC_BITS: u8 = 12;

/// See the module's page.
pub struct F405;

impl Board for F405 {
    type Drive = F405Drive;
    type Bytes = UartBytes;
    type Port = UartPort;

    const NAME: &'static str = "STM32F405";

    fn start(
        device: pac::Peripherals,
        mut core: cortex_m::Peripherals,
    ) -> Result<Parts<Self>, StartFault> {
        let mut watchdog = IndependentWatchdog::new(device.IWDG);
        watchdog.start(START_LIMIT_MS.millis());

        start_crystal(&device.RCC)?;
        let clocks = Config::hse(CRYSTAL_MHZ.MHz()).sysclk(168.MHz());
        let mut rcc = device.RCC.freeze(clocks);

        let a = device.GPIOA.split(&mut rcc);
        let b = device.GPIOB.split(&mut rcc);
        let c = device.GPIOC.split(&mut rcc);

        let enable = b.pb0.into_push_pull_output().erase();
        let (mut torque_1, mut torque_2) = device
            .DAC
            .constrain((a.pa4.into_analog(), a.pa5.into_analog()), &mut rcc);
        torque_1.set_value(NO_TORQUE);
        torque_2.set_value(NO_TORQUE);
        torque_1.enable();
        torque_2.enable();

        let line = config::Config::default().baudrate(uart::BAUD.bps());
        let serial = Serial::new(device.USART1, (a.pa9, a.pa10), line, &mut rcc);
        let serial = serial.map_err(|_| StartFault::Link)?;
        let (bytes, port) = uart::split(serial).ok_or(StartFault::Link)?;

        let mode_0 = Mode {
            polarity: Polarity::IdleLow,
            phase: Phase::CaptureOnFirstTransition,
        };
        let mode_1 = Mode {
            polarity: Polarity::IdleLow,
            phase: Phase::CaptureOnSecondTransition,
        };
        // Two of these are the debugger's at reset; it needs them for JTAG only.
        let pins = (
            Some(b.pb3.into_alternate::<5>()),
            Some(b.pb4.into_alternate::<5>()),
            Some(b.pb5.into_alternate::<5>()),
        );
        let encoders = Encoders {
            bus: Spi::new(device.SPI1, pins, mode_1, 8.MHz(), &mut rcc),
            selects: [
                b.pb6.into_push_pull_output_in_state(PinState::High).erase(),
                b.pb7.into_push_pull_output_in_state(PinState::High).erase(),
            ],
        };
        let pins = (Some(b.pb13), Some(b.pb14), Some(b.pb15));
        let bus = Spi::new(device.SPI2, pins, mode_0, 2.MHz(), &mut rcc);
        let select = b
            .pb12
            .into_push_pull_output_in_state(PinState::High)
            .erase();
        let force_cell =
            ExclusiveDevice::new_no_delay(bus, select).map_err(|_| StartFault::Link)?;

        pac::TIM2::enable(&mut rcc);
        core.DCB.enable_trace();
        core.DWT.enable_cycle_counter();
        Ok(Parts {
            drive: F405Drive {
                timer_hz: rcc.clocks.timclk1().raw(),
                core_hz: rcc.clocks.sysclk().raw(),
                timer: device.TIM2,
                watchdog,
                torque_1,
                torque_2,
                torque_bits: DAC_BITS,
                enable,
                encoders,
                force_cell: ForceCell(force_cell),
                inputs: [
                    c.pc0.into_pull_down_input().erase(),
                    c.pc1.into_pull_down_input().erase(),
                ],
                plant: Plant::Lockstep,
                sequence: 0,
            },
            bytes,
            port,
        })
    }

    #[allow(unsafe_code)]
    fn take_torque_off() {
        // SAFETY: called with interrupts off by a program that is at its end; both
        // writes are single stores, and nobody is left to disagree with them.
        unsafe {
            (*pac::GPIOB::ptr()).bsrr().write(|w| w.br0().set_bit());
            (*pac::DAC::ptr())
                .dhr12rd()
                .write(|w| w.bits(u32::from(NO_TORQUE) << 16 | u32::from(NO_TORQUE)));
        }
    }

    /// Until the watchdog resets the chip, which then waits for a configuration with
    /// the torque off.
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

/// Starts the crystal oscillator, or gives up. Nothing in it waits without a bound.
fn start_crystal(rcc: &pac::RCC) -> Result<(), StartFault> {
    rcc.cr().modify(|_, w| w.hseon().set_bit());
    let settled = (0..CRYSTAL_PATIENCE).any(|_| rcc.cr().read().hserdy().bit_is_set());
    if settled {
        Ok(())
    } else {
        Err(StartFault::Clock)
    }
}

/// What the control task uses.
pub struct F405Drive {
    timer: pac::TIM2,
    timer_hz: u32,
    core_hz: u32,
    watchdog: IndependentWatchdog,
    torque_1: C1,
    torque_2: C2,
    /// Bits of the torque counts that the controller gives.
    torque_bits: u8,
    enable: ErasedPin<Output>,
    encoders: Encoders<Spi<SPI1>, ErasedPin<Output>>,
    force_cell: ForceCell<ExclusiveDevice<Spi<SPI2>, ErasedPin<Output>, NoDelay>>,
    /// Enable and reset.
    inputs: [ErasedPin<Input>; 2],
    plant: Plant,
    sequence: u32,
}

impl F405Drive {
    fn read_sensors(&mut self) -> SensorFrame {
        let (tangential_force, normal_force) = self.force_cell.read();
        let [enable, reset] = &self.inputs;
        let level = |pin: &ErasedPin<Input>, input| {
            if pin.is_high() {
                input
            } else {
                DigitalInputs::default()
            }
        };
        self.sequence = self.sequence.wrapping_add(1);
        SensorFrame {
            tick: self.sequence,
            sequence: self.sequence,
            joints: self.encoders.read(),
            normal_force,
            tangential_force,
            inputs: level(enable, DigitalInputs::ENABLE) | level(reset, DigitalInputs::RESET),
        }
    }

    /// The DAC's code for a torque: offset binary of 12 bits.
    fn code(&self, torque: TorqueCounts) -> u16 {
        let counts = if self.torque_bits > DAC_BITS {
            torque.0 >> (self.torque_bits - DAC_BITS)
        } else {
            torque.0 << (DAC_BITS - self.torque_bits)
        };
        (counts + i32::from(NO_TORQUE)).clamp(0, (1 << DAC_BITS) - 1) as u16
    }
}

impl Drive for F405Drive {
    fn start(&mut self, configuration: &Configuration, plant: Plant) {
        self.torque_bits = configuration.converters.torque.bits;
        self.plant = plant;
        timer::set_back(&self.timer);
        timer::start(&self.timer, self.timer_hz as f32 / configuration.tick_hz);
        self.watchdog.start(TICK_LIMIT_MS.millis());
    }

    fn begin_tick(&mut self) {
        timer::acknowledge(&self.timer);
        self.watchdog.feed();
    }

    fn next_tick_is_due(&self) -> bool {
        timer::is_due(&self.timer)
    }

    fn sample(&mut self, from_host: Option<SensorFrame>) -> Option<SensorFrame> {
        match self.plant {
            Plant::Lockstep | Plant::Realtime => from_host,
            Plant::Real => Some(self.read_sensors()),
        }
    }

    fn actuate(&mut self, answer: &ActuatorFrame) {
        let [torque_1, torque_2] = answer.torques;
        let (code_1, code_2) = (self.code(torque_1), self.code(torque_2));
        self.torque_1.set_value(code_1);
        self.torque_2.set_value(code_2);
        let drives = answer
            .supervisor_state()
            .is_some_and(|state| !matches!(state, SupervisorState::Idle | SupervisorState::Fault));
        let level = if drives {
            PinState::High
        } else {
            PinState::Low
        };
        self.enable.set_state(level);
    }

    fn stopwatch(&self) -> u32 {
        DWT::cycle_count()
    }

    fn stopwatch_hz(&self) -> u32 {
        self.core_hz
    }
}

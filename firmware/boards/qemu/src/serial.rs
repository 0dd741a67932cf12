//! QEMU's `netduinoplus2` with the flash target's serial port as the link.
//!
//! It runs by a clock of its own and is there to test the serial port's driver and what
//! hardware in the loop needs; for everything else see the lockstep board.

use stm32f4xx_hal::pac;
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::serial::{Serial, config};

use crate::pipes::{Qemu, Timers};
use painleve_image::board::{Board, Parts, StartFault};
use painleve_stm32f4::uart::{self, UartBytes, UartPort};

/// See the module's page.
pub struct QemuSerial;

impl Board for QemuSerial {
    type Device = pac::Peripherals;
    type Drive = Timers;
    type Bytes = UartBytes;
    type Port = UartPort;

    const NAME: &'static str = "netduinoplus2 under QEMU, serial port";

    fn start(
        device: pac::Peripherals,
        _: cortex_m::Peripherals,
    ) -> Result<Parts<Self>, StartFault> {
        // QEMU has no clock tree and sends as fast as the host reads.
        let mut rcc = device.RCC.constrain();
        let a = device.GPIOA.split(&mut rcc);
        let line = config::Config::default().baudrate(uart::BAUD.bps());
        let serial = Serial::new(device.USART1, (a.pa9, a.pa10), line, &mut rcc);
        let serial = serial.map_err(|_| StartFault::Link)?;
        let (bytes, port) = uart::split(serial).ok_or(StartFault::Link)?;
        Ok(Parts {
            drive: Timers::start(device.TIM2, device.TIM5),
            bytes,
            port,
        })
    }

    fn take_torque_off() {}

    fn halt() -> ! {
        Qemu::halt()
    }

    /// Unlike in lockstep the clock goes on by itself; several of these share a machine.
    fn idle() {
        cortex_m::asm::wfi();
    }
}

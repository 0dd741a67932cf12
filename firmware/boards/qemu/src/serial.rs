//! QEMU's `netduinoplus2` with the flash target's serial port as the link.
//!
//! Its clock runs independently of the host. The board tests the serial port's driver and the
//! host's support for hardware in the loop; for everything else use the lockstep board.

use stm32f4xx_hal::pac;
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::serial::{Serial, config};

use crate::pipes::{Qemu, Timers};
use painleve_image::board::{Board, Parts, StartFault};
use painleve_image::memory::NoMemory;
use painleve_stm32f4::uart::{self, UartBytes, UartPort};

/// The board; see the module's page.
pub struct QemuSerial;

impl Board for QemuSerial {
    type Device = pac::Peripherals;
    type Drive = Timers;
    type Bytes = UartBytes;
    type Port = UartPort;
    type Memory = NoMemory;

    const NAME: &'static str = "netduinoplus2 under QEMU, serial port";

    fn start(
        device: pac::Peripherals,
        _: cortex_m::Peripherals,
    ) -> Result<Parts<Self>, StartFault> {
        // QEMU models no clock tree and sends as fast as the host reads.
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
            memory: NoMemory,
        })
    }

    fn take_torque_off() {}

    fn halt() -> ! {
        Qemu::halt()
    }

    /// Yields: unlike in lockstep the clock runs on by itself, and several of these boards share a
    /// machine.
    fn idle() {
        cortex_m::asm::wfi();
    }
}

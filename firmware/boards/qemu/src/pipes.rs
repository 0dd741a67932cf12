//! QEMU's `netduinoplus2`: an STM32F405, the chip of the flash target.
//!
//! `mps2-an386` would offer a finer timer and a serial port in virtual time, but has another memory
//! map and other timers. Here the control timer, its interrupt and the memory map are those of the
//! flash target. QEMU models neither its clock tree nor its converters and watchdogs: the arm's
//! frames come through the link.
//!
//! The link is semihosting on two pipes that QEMU inherits, with the descriptors 100 and 101. The
//! virtual clock stands still during a semihosting call, so that a run under `-icount` is
//! deterministic to the instruction, however long the host takes.

use defmt_semihosting as _;
use painleve_firmware::Configuration;
use painleve_firmware::drive::Drive;
use painleve_firmware::law::Law;
use painleve_shared::frame::{ActuatorFrame, DigitalInputs, SensorFrame};
use painleve_shared::message::FrameSource;
use semihosting::fs::File;
use semihosting::io::{Read, Write};
use stm32f4xx_hal::pac;

use painleve_image::board::{Board, BoardDrive, Bytes, Parts, Port, StartFault};
use painleve_image::memory::NoMemory;
use painleve_stm32f4::timer;

/// QEMU's timers count nanoseconds of virtual time, whatever the clock settings are.
const TIMER_HZ: f32 = 1e9;

/// The board; see the module's page.
pub struct Qemu;

impl Board for Qemu {
    type Device = pac::Peripherals;
    type Drive = Timers;
    type Bytes = NoBytes;
    type Port = Pipes;
    type Memory = NoMemory;

    const NAME: &'static str = "netduinoplus2 under QEMU";

    fn start(
        device: pac::Peripherals,
        _: cortex_m::Peripherals,
    ) -> Result<Parts<Self>, StartFault> {
        Ok(Parts {
            drive: Timers::start(device.TIM2, device.TIM5),
            bytes: NoBytes,
            port: Pipes {
                requests: File::open(c"/dev/fd/100").map_err(|_| StartFault::Link)?,
                responses: File::create(c"/dev/fd/101").map_err(|_| StartFault::Link)?,
            },
            memory: NoMemory,
        })
    }

    /// Ends the image: the host detects it and takes the torque off in its simulation.
    fn take_torque_off() {}

    fn halt() -> ! {
        semihosting::process::exit(1)
    }

    #[allow(unsafe_code)]
    fn idle() {
        // No wait for interrupt: with one timer running, QEMU's virtual clock would jump past its
        // deadline. Straight-line code is one block to QEMU and many times faster than a loop.
        // SAFETY: has no effect.
        unsafe { core::arch::asm!(".rept 200", "nop", ".endr", options(nomem, nostack)) }
    }
}

/// The control timer and the stopwatch.
pub struct Timers {
    control: pac::TIM2,
    stopwatch: pac::TIM5,
    /// Newest frame from the host: the plant is always simulated.
    from_host: Option<SensorFrame>,
}

impl Timers {
    /// Starts the stopwatch.
    pub fn start(control: pac::TIM2, stopwatch: pac::TIM5) -> Self {
        stopwatch.arr().write(|w| w.arr().set(u32::MAX));
        stopwatch.cr1().write(|w| w.cen().set_bit());
        Self {
            control,
            stopwatch,
            from_host: None,
        }
    }
}

impl Drive for Timers {
    fn begin_tick(&mut self) {
        timer::acknowledge(&self.control);
    }

    fn sample(&mut self) -> Option<SensorFrame> {
        let frame = self.from_host.take();
        let overload = |frame: SensorFrame| frame.inputs.contains(DigitalInputs::OVERLOAD);
        if frame.is_some_and(overload) {
            while !self.next_tick_is_due() {}
        }
        frame
    }

    /// The answer on the link serves as the output.
    fn actuate(&mut self, _: &ActuatorFrame) {}

    fn next_tick_is_due(&self) -> bool {
        timer::is_due(&self.control)
    }

    fn stopwatch(&self) -> u32 {
        self.stopwatch.cnt().read().bits()
    }
}

impl BoardDrive for Timers {
    fn start<L: Law>(&mut self, configuration: &Configuration<L>, _: FrameSource) {
        self.from_host = None;
        timer::start(&self.control, TIMER_HZ / configuration.tick_hz);
    }

    fn offer(&mut self, frame: SensorFrame) {
        self.from_host = Some(frame);
    }

    fn stopwatch_hz(&self) -> u32 {
        TIMER_HZ as u32
    }
}

/// The serial port's interrupt, which semihosting does not have.
pub struct NoBytes;

impl Bytes for NoBytes {
    fn serve(&mut self) {}
}

/// The link: a pipe in each direction.
pub struct Pipes {
    requests: File,
    responses: File,
}

impl Port for Pipes {
    const HALF_DUPLEX: bool = true;

    /// Blocks, with all of virtual time, until the host sends a request. Ends the image if the host
    /// is gone.
    fn receive(&mut self, buffer: &mut [u8]) -> usize {
        match self.requests.read(buffer) {
            Ok(length) if length > 0 => length,
            _ => Qemu::halt(),
        }
    }

    fn send(&mut self, bytes: &[u8]) -> bool {
        self.responses.write_all(bytes).is_ok()
    }
}

//! The interface between the tasks and a board. Boards differ in nothing else.

use embedded_storage::nor_flash::NorFlash;
use painleve_firmware::Configuration;
use painleve_firmware::drive::Drive;
use painleve_firmware::law::Law;
use painleve_shared::black_box::ResetCause;
use painleve_shared::frame::SensorFrame;
use painleve_shared::message::{FrameSource, RefusedRate};

use crate::dma_serial::{DmaBytes, DmaRegisters};
use crate::memory::FlashMemory;
use crate::port::Port;
use crate::probe::SpareBits;

/// Reason for a failed start of a board.
#[derive(Clone, Copy, Debug, PartialEq, Eq, defmt::Format)]
pub enum StartFault {
    /// The crystal oscillator or the phase-locked loop did not settle in time.
    Clock,
    /// The supply is too low.
    Supply,
    /// The link to the host cannot be opened.
    Link,
    /// The brown-out level could not be programmed.
    OptionBytes,
}

/// A board, split into the parts that each task owns.
pub struct Parts<B: Board> {
    /// Part of the control task.
    pub drive: B::Drive,
    /// Part of the serial port's interrupt.
    pub bytes: DmaBytes<B::Serial>,
    /// Part of the link task.
    pub port: B::Port,
    /// Part of the link task: keeps a configuration.
    pub memory: FlashMemory<B::Flash>,
}

/// A microcontroller board with the arm, or a stand-in for it, on its pins.
pub trait Board {
    /// The chip's peripherals.
    type Device;
    /// Type that the control task owns.
    type Drive: BoardDrive;
    /// Registers of the serial port.
    type Serial: DmaRegisters;
    /// Type that the link task owns.
    type Port: Port;
    /// Flash that keeps a configuration over a loss of power.
    type Flash: NorFlash;

    /// Name, for the log.
    const NAME: &'static str;

    /// Starts clocks, pins and peripherals in bounded time.
    ///
    /// # Errors
    /// [`StartFault`]; the torque is off.
    fn start(device: Self::Device, core: cortex_m::Peripherals) -> Result<Parts<Self>, StartFault>
    where
        Self: Sized;

    /// Returns the reason for the processor's last reset, and clears it.
    fn reset_cause() -> ResetCause;

    /// Handles a non-maskable interrupt of the configuration's memory; returns whether it was one. Any other is
    /// that of a stopped crystal.
    fn take_memory_fault() -> bool {
        false
    }

    /// Takes the torque off in any state of the program.
    fn take_torque_off();

    /// Takes the torque off and never returns.
    fn halt() -> !;

    /// Idles; called repeatedly while there is nothing else to do.
    fn idle();
}

/// The control task's part of a board: a [`Drive`] with a timer that can be started, and with an
/// input for frames from the host instead of the board's own sensors.
pub trait BoardDrive: Drive {
    /// Bits that a host may change while nothing is driven.
    const SPARE: &'static [SpareBits];

    /// Checks that the board can watch over ticks at this rate, with frames from `source`.
    ///
    /// # Errors
    /// The rate, and the nearest ones at which it can.
    fn check_rate(&self, tick_hz: f32, source: FrameSource) -> Result<(), RefusedRate>;

    /// Starts the control timer's interrupt at the configuration's rate, with frames from `source`.
    /// Discards a frame offered before.
    fn start<L: Law>(&mut self, configuration: &Configuration<L>, source: FrameSource);

    /// Returns to the control rate of a board without a configuration. The torque is off. Building the
    /// next controller may take longer than a tick of the last one, and must not look like a program
    /// that hangs.
    fn idle(&mut self);

    /// Takes the newest frame from the link, for a plant that the host simulates.
    fn offer(&mut self, frame: SensorFrame);

    /// Permits or forbids the drive to arm; returns whether it may.
    fn permit_arming(&mut self, permitted: bool) -> bool;

    /// Serves the interrupt of one of the sensors' buses, by its number in [`tasks!`](crate::tasks!).
    fn serve_sensor_bus(&mut self, bus: usize);

    /// Returns the frequency of [`Drive::stopwatch`], Hz.
    fn stopwatch_hz(&self) -> u32;
}

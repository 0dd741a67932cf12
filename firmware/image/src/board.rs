//! What the tasks need of a board. Nothing else differs between boards.

use painleve_firmware::Configuration;
use painleve_firmware::drive::Drive;
use painleve_firmware::law::Law;
use painleve_shared::frame::SensorFrame;
use painleve_shared::message::FrameSource;

/// Why a board does not start.
#[derive(Clone, Copy, Debug, PartialEq, Eq, defmt::Format)]
pub enum StartFault {
    /// The crystal oscillator or the phase-locked loop did not settle in time.
    Clock,
    /// The link to the host cannot be opened.
    Link,
}

/// A board, taken apart into what each task owns.
pub struct Parts<B: Board> {
    /// For the control task.
    pub drive: B::Drive,
    /// For the serial port's interrupt.
    pub bytes: B::Bytes,
    /// For the link task.
    pub port: B::Port,
}

/// A microcontroller board with the arm, or a stand-in for it, on its pins.
pub trait Board {
    /// The chip's peripherals.
    type Device;
    /// What the control task uses.
    type Drive: BoardDrive;
    /// What the serial port's interrupt uses.
    type Bytes: Bytes;
    /// What the link task uses.
    type Port: Port;

    /// Name, for the banner.
    const NAME: &'static str;

    /// Starts clocks, pins and peripherals in bounded time.
    fn start(device: Self::Device, core: cortex_m::Peripherals) -> Result<Parts<Self>, StartFault>
    where
        Self: Sized;

    /// Takes the torque off, whatever state the program is in.
    fn take_torque_off();

    /// Takes the torque off and stays there.
    fn halt() -> !;

    /// Called again and again while nothing else is to be done.
    fn idle();
}

/// The side of the control task: a [`Drive`] whose timer can be started, and which may be given
/// frames from the host instead of its own sensors'.
pub trait BoardDrive: Drive {
    /// Starts the control timer's interrupt at the configuration's rate, with frames from
    /// `source`; a frame that was offered before is forgotten.
    fn start<L: Law>(&mut self, configuration: &Configuration<L>, source: FrameSource);

    /// Takes the newest frame from the link, for a plant that is simulated on the other side of it.
    fn offer(&mut self, frame: SensorFrame);

    /// How fast [`Drive::stopwatch`] counts, Hz.
    fn stopwatch_hz(&self) -> u32;
}

/// The side of the serial port's interrupt.
pub trait Bytes {
    /// Moves bytes between the port and its buffers.
    fn serve(&mut self);
}

/// The side of the link task: bytes to and from the host.
pub trait Port {
    /// Whether more bytes have to wait until the host has read its answer.
    const HALF_DUPLEX: bool;

    /// Moves received bytes into `buffer`; returns how many, 0 when there are none.
    fn receive(&mut self, buffer: &mut [u8]) -> usize;

    /// Sends bytes, all of them or, if the host does not take them, none.
    fn send(&mut self, bytes: &[u8]) -> bool;
}

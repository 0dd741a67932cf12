//! The wired board as seen from outside: sensors, switches, torque stages, serial line.

use std::path::PathBuf;

use painleve_chips::{As5048a, BridgeAmplifier, Mcp3304, SpiPart, Transfer};
use painleve_plant::law_choice::build;
use painleve_shared::frame::{ActuatorFrame, SensorFrame};
use painleve_shared::message::{FrameSource, MAXIMUM_LENGTH, Request, Response};
use painleve_shared::wire::{self, Inbox};
use painleve_tests::built_image;

use crate::bare::BareBench;
use painleve_chips::machine::{Machine, MachineSnapshot, Reset};
use painleve_chips::stm32::{Outside, Pin, PinLevel, PinMode, WiredChip};
use painleve_chips::stm32f4::Stm32f4;
use painleve_chips::stm32g4::Stm32g4;
use painleve_chips::{MILLISECOND, Picoseconds, SECOND};

/// The pin that enables the torque stages.
pub const STAGES: Pin = (1, 0);
/// The switch of the safety chain.
pub const ENABLE: Pin = (2, 0);
/// The push button that resets a fault.
pub const RESET: Pin = (2, 1);
/// Both torque stages are ready.
pub const STAGES_READY: Pin = (2, 2);
/// Selects of the encoders, the second ones last, and of the force cells' converters.
const SELECTS: [Pin; 6] = [(1, 6), (1, 7), (1, 10), (1, 11), (1, 12), (1, 1)];

/// Duration of a byte on the serial line.
const BYTE: Picoseconds = 10 * SECOND / 921_600;

/// The parts on the pins.
#[derive(Clone, Debug, Default)]
pub struct BoardWiring {
    /// Encoders of θ1 and of the elbow.
    pub encoders: [As5048a; 2],
    /// Converter of the force cell.
    pub force: Mcp3304,
    /// Bridge amplifiers of f_n and f_t.
    pub bridges: [BridgeAmplifier; 2],
    /// Second encoders of θ1 and of the elbow.
    pub second_encoders: [As5048a; 2],
    /// Converter of the second force cell.
    pub second_force: Mcp3304,
    selected: [bool; 6],
    /// Level at which the image drives the torque stages' pin; `None` while the pin floats.
    pub stages: Option<bool>,
    /// What is on the pins in place of all these parts.
    pub bare: Option<BareBench>,
}

impl BoardWiring {
    fn part(&mut self, index: usize) -> &mut dyn SpiPart {
        match index {
            0 | 1 => &mut self.encoders[index],
            2 | 3 => &mut self.second_encoders[index - 2],
            4 => &mut self.force,
            _ => &mut self.second_force,
        }
    }

    /// Returns the data-sheet limits that the image has violated.
    pub fn violations(&self) -> Vec<&'static str> {
        let encoders = self.encoders.iter().chain(&self.second_encoders);
        let encoders = encoders.flat_map(|it| it.violations());
        let converters = [&self.force, &self.second_force];
        let converters = converters.into_iter().flat_map(|it| it.violations());
        encoders.chain(converters).copied().collect()
    }
}

impl Outside for BoardWiring {
    fn pin(&mut self, pin: Pin, level: Option<bool>, now: Picoseconds) -> Option<PinLevel> {
        if pin == STAGES {
            self.stages = level;
        }
        if let Some(index) = SELECTS.iter().position(|it| *it == pin) {
            // Pulled up on the board.
            let is_selected = level == Some(false);
            if is_selected != self.selected[index] {
                self.selected[index] = is_selected;
                if is_selected {
                    self.part(index).select(now);
                } else {
                    self.part(index).deselect(now);
                }
            }
        }
        self.bare.as_mut()?.carry(pin, level)
    }

    fn code_at_output(&mut self, channel: usize, code: u32) -> u32 {
        match &mut self.bare {
            None => code,
            Some(bare) => bare.code_at_output(channel, code),
        }
    }

    fn transfer(&mut self, bus: usize, transfer: Transfer, now: Picoseconds) -> u16 {
        if let Some(bare) = &mut self.bare {
            return bare.answer(bus, transfer.bits);
        }
        let candidates = if bus == 0 { 0..4 } else { 4..6 };
        let mut answer = u16::MAX;
        for index in candidates {
            if self.selected[index] {
                answer &= self.part(index).transfer(&transfer, now);
            }
        }
        if transfer.bits == 8 {
            answer & 0xff
        } else {
            answer
        }
    }
}

/// Inputs of the torque stages.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Torque {
    /// Whether the stages are enabled; `None` for a floating pin.
    pub enabled: Option<bool>,
    /// Codes of the converter, relative to the code for zero torque.
    pub counts: [i32; 2],
}

impl Torque {
    /// Returns whether the image holds the stages off.
    pub fn is_off(&self) -> bool {
        self.enabled == Some(false)
    }
}

/// A chip on a board: which image it executes.
pub trait BoardChip: WiredChip<Outside = BoardWiring> {
    /// Name of its image.
    const IMAGE: &'static str;

    /// Bit of its option bytes without which configurations cannot be stored.
    const SLOT_OPTION: u32;
    /// Bit of its protection against reading.
    const READ_OPTION: u32;
}

/// The STM32F405 of a wired board.
pub type F405 = Stm32f4<BoardWiring>;

/// The STM32G474 of a wired board.
pub type G474 = Stm32g4<BoardWiring>;

impl BoardChip for F405 {
    const IMAGE: &'static str = "painleve-f405";
    const SLOT_OPTION: u32 = 1 << 26;
    const READ_OPTION: u32 = 1 << 8;
}

impl BoardChip for G474 {
    const IMAGE: &'static str = "painleve-g474";
    const SLOT_OPTION: u32 = 1 << 22;
    const READ_OPTION: u32 = 1;
}

/// The board with the STM32F405.
pub type FlashedBoard = EmulatedBoard<F405>;

/// The board NUCLEO-G474RE.
pub type FlashedNucleo = EmulatedBoard<G474>;

/// State of a board at one instant.
pub struct BoardSnapshot<C = F405> {
    machine: MachineSnapshot<C>,
    inbox: Inbox,
    heard: usize,
    line_free: Picoseconds,
}

/// A powered board on a bench with the image in its flash.
pub struct EmulatedBoard<C: BoardChip> {
    /// The microcontroller.
    pub machine: Machine<C>,
    inbox: Inbox,
    heard: usize,
    /// Time until which the line to the board is busy.
    line_free: Picoseconds,
}

/// Returns the path of the library: `PAINLEVE_UNICORN`, or where `cargo xtask setup` installs it.
///
/// # Panics
/// If it is not installed.
pub fn library() -> PathBuf {
    if let Some(path) = std::env::var_os("PAINLEVE_UNICORN") {
        return path.into();
    }
    // One folder is named after the version of Python.
    let versions = std::fs::read_dir(workspace().join("target/unicorn/lib"));
    let mut libraries = versions.into_iter().flatten().flatten().map(|version| {
        let packages = version.path().join("site-packages");
        packages.join("unicorn/lib/libunicorn.so.2")
    });
    libraries
        .find(|it| it.exists())
        .unwrap_or_else(|| panic!("Unicorn is not installed: run `cargo xtask setup`"))
}

fn workspace() -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
}

impl<C: BoardChip> Default for EmulatedBoard<C> {
    fn default() -> Self {
        Self::with_oscillator(32_000)
    }
}

impl<C: BoardChip> EmulatedBoard<C> {
    /// Creates a powered board with a healthy arm that is not enabled; nothing has been executed.
    pub fn with_oscillator(watchdog_hz: u64) -> Self {
        let mut chip = C::without_power(BoardWiring::default(), watchdog_hz);
        chip.drive_pin(ENABLE, Some(false));
        chip.drive_pin(RESET, Some(false));
        chip.drive_pin(STAGES_READY, Some(true));
        Self {
            machine: Machine::new(&library(), &built_image(C::IMAGE), chip),
            inbox: Inbox::new(),
            heard: 0,
            line_free: 0,
        }
    }

    /// Creates a powered board without an arm: wires and open lines in place of its parts. Nothing has been executed.
    pub fn bare(watchdog_hz: u64, bare: BareBench) -> Self {
        let mut board = Self::with_oscillator(watchdog_hz);
        for (pin, level) in bare.at_rest() {
            board.machine.chip_mut().drive_pin(pin, level);
        }
        board.wiring().bare = Some(bare);
        board
    }

    /// Creates a powered board that has booted and is idle.
    ///
    /// # Panics
    /// If the image was reset meanwhile.
    pub fn booted() -> Self {
        let mut board = Self::default();
        board.machine.run_for(20 * MILLISECOND);
        assert_eq!(board.machine.resets.len(), 1, "{:?}", board.machine.resets);
        board
    }

    /// Returns the parts on the pins.
    pub fn wiring(&mut self) -> &mut BoardWiring {
        self.machine.chip_mut().outside_mut()
    }

    /// Returns the inputs of the torque stages.
    pub fn torque(&self) -> Torque {
        let chip = self.machine.chip();
        let enabled = match chip.pin(STAGES) {
            PinMode::Output(level) => Some(level),
            _ => None,
        };
        Torque {
            enabled,
            counts: chip.dac_codes().map(|code| code as i32 - 2048),
        }
    }

    /// Returns the complete state.
    pub fn snapshot(&self) -> BoardSnapshot<C> {
        BoardSnapshot {
            machine: self.machine.snapshot(),
            inbox: self.inbox.clone(),
            heard: self.heard,
            line_free: self.line_free,
        }
    }

    /// Restores a snapshot.
    pub fn restore(&mut self, snapshot: &BoardSnapshot<C>) {
        self.machine.restore(&snapshot.machine);
        self.inbox = snapshot.inbox.clone();
        self.heard = snapshot.heard;
        self.line_free = snapshot.line_free;
    }

    /// Opens or closes the switch of the safety chain.
    pub fn enable(&mut self, closed: bool) {
        self.machine.chip_mut().drive_pin(ENABLE, Some(closed));
    }

    /// Returns the causes of all resets since power-up.
    pub fn resets(&self) -> Vec<Reset> {
        self.machine
            .resets
            .iter()
            .skip(1)
            .map(|(_, it)| *it)
            .collect()
    }

    /// Returns whether the line to the board takes more bytes: those on it pass within a millisecond.
    pub fn line_takes_more(&self) -> bool {
        self.line_free <= self.machine.now() + MILLISECOND
    }

    /// Queues bytes on the line to the board.
    pub fn send_bytes(&mut self, bytes: &[u8]) {
        let start = self.machine.now().max(self.line_free);
        let usart = self.machine.chip_mut().usart_mut();
        let mut at = start;
        for byte in bytes {
            at += BYTE;
            usart.incoming.push_back((at, *byte));
        }
        self.line_free = at;
    }

    /// Queues bytes on the line with a given pause between them.
    pub fn send_slowly(&mut self, bytes: &[u8], apart: Picoseconds) {
        let mut at = self.machine.now().max(self.line_free);
        for byte in bytes {
            at += apart;
            self.machine
                .chip_mut()
                .usart_mut()
                .incoming
                .push_back((at, *byte));
        }
        self.line_free = at;
    }

    /// Sends a request.
    pub fn send(&mut self, request: &Request<'_>) {
        let mut buffer = [0; MAXIMUM_LENGTH];
        let bytes = wire::encode(request, &mut buffer).unwrap_or_else(|error| panic!("{error}"));
        self.send_bytes(bytes);
    }

    /// Sends a configuration encoded with postcard.
    pub fn configure(&mut self, source: FrameSource, configuration: &[u8]) -> Option<Response> {
        self.send(&Request::Configure {
            build: build(),
            source,
            configuration,
        });
        self.reply(20 * MILLISECOND)
    }

    /// Lets the host permit the drive to arm; whether the board agrees.
    pub fn permit_arming(&mut self) -> bool {
        self.send(&Request::PermitArming(true));
        self.reply(20 * MILLISECOND) == Some(Response::Permission(true))
    }

    /// Takes the bytes that the board has sent since the last call.
    pub fn take_sent(&mut self) -> Vec<u8> {
        let sent = self.machine.chip().usart().outgoing[self.heard..].to_vec();
        self.heard += sent.len();
        sent
    }

    /// The next response that is not the answer to a tick, if it comes within `limit`.
    pub fn reply(&mut self, limit: Picoseconds) -> Option<Response> {
        let end = self.machine.now() + limit;
        loop {
            match self.response(end.saturating_sub(self.machine.now()))? {
                Response::Actuator { .. } | Response::Tick { .. } => {}
                reply => return Some(reply),
            }
        }
    }

    /// Returns the next response, if it arrives within `limit`.
    pub fn response(&mut self, limit: Picoseconds) -> Option<Response> {
        let end = self.machine.now() + limit;
        loop {
            while let Some(byte) = self
                .machine
                .chip()
                .usart()
                .outgoing
                .get(self.heard)
                .copied()
            {
                self.heard += 1;
                if let Some(message) = self.inbox.push(byte)
                    && let Ok(response) = wire::decode(message)
                {
                    return Some(response);
                }
            }
            if self.machine.now() >= end {
                return None;
            }
            self.machine.run_for(MILLISECOND / 50);
        }
    }

    /// Sends a frame and returns the answer, if it arrives within three milliseconds.
    pub fn exchange(&mut self, frame: &SensorFrame) -> Option<ActuatorFrame> {
        self.send(&Request::Sensor(*frame));
        match self.response(3 * MILLISECOND) {
            Some(Response::Actuator { frame, .. }) => Some(frame),
            _ => None,
        }
    }
}

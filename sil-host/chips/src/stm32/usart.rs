//! A USART (RM0090, section 30; RM0440, chapter USART) and the host's end of its line.

use std::collections::VecDeque;

use crate::{Picoseconds, SECOND};

const OVERRUN: u32 = 1 << 3;
const FRAMING: u32 = 1 << 1;
const IDLE: u32 = 1 << 4;
const RECEIVED: u32 = 1 << 5;
const COMPLETE: u32 = 1 << 6;
const EMPTY: u32 = 1 << 7;

/// Bits of the first control register that switch transmitter and receiver on.
const TRANSMITTER: u32 = 1 << 3;
const RECEIVER: u32 = 1 << 2;

/// Rate of the host's end, bit/s.
const HOST_BAUD: u64 = 921_600;

/// The two arrangements of a USART's registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UsartLayout {
    /// One data register; flags are cleared by reading them and the data.
    SharedData,
    /// Two data registers; flags are cleared by a register of their own.
    SeparateData,
}

/// A register.
enum Register {
    Flags,
    Clear,
    Received,
    ToSend,
    Baud,
    Control(usize),
    Other,
}

impl UsartLayout {
    fn register(self, offset: u32, is_load: bool) -> Register {
        match (self, offset) {
            (Self::SharedData, 0x00) | (Self::SeparateData, 0x1c) => Register::Flags,
            (Self::SeparateData, 0x20) => Register::Clear,
            (Self::SharedData, 0x04) if is_load => Register::Received,
            (Self::SharedData, 0x04) | (Self::SeparateData, 0x28) => Register::ToSend,
            (Self::SeparateData, 0x24) => Register::Received,
            (Self::SharedData, 0x08) | (Self::SeparateData, 0x0c) => Register::Baud,
            (Self::SharedData, 0x0c..0x18) => Register::Control((offset / 4 - 3) as usize),
            (Self::SeparateData, 0x00..0x0c) => Register::Control((offset / 4) as usize),
            _ => Register::Other,
        }
    }

    /// Bits of the control registers that a line of 8N1 may set, and those that switch interrupts and DMA on. All
    /// others change the format or the timing.
    fn known(self) -> [u32; 3] {
        const INTERRUPTS: u32 = 0x1f0;
        const ERRORS_AND_DMA: u32 = 1 | 3 << 6;
        [
            self.enable() | INTERRUPTS | TRANSMITTER | RECEIVER,
            0,
            ERRORS_AND_DMA,
        ]
    }

    /// The bit of the first control register that switches the port on.
    fn enable(self) -> u32 {
        match self {
            Self::SharedData => 1 << 13,
            Self::SeparateData => 1,
        }
    }
}

/// Registers of a USART.
#[derive(Clone, Debug)]
pub struct Usart {
    layout: UsartLayout,
    flags: u32,
    baud: u32,
    control: [u32; 3],
    received: u32,
    /// Whether the flags have been read, so that reading the data clears them.
    armed: bool,
    waiting: Option<u8>,
    shifting: Option<(u8, Picoseconds)>,
    line_idle_at: Option<Picoseconds>,
    /// Bytes in transit from the host, with their arrival times.
    pub incoming: VecDeque<(Picoseconds, u8)>,
    /// Bytes received by the host.
    pub outgoing: Vec<u8>,
    /// Bytes lost because the previous byte had not been read.
    pub overruns: u32,
}

impl Usart {
    /// Creates the port in its reset state.
    pub fn new(layout: UsartLayout) -> Self {
        Self {
            layout,
            flags: EMPTY | COMPLETE,
            baud: 0,
            control: [0; 3],
            received: 0,
            armed: false,
            waiting: None,
            shifting: None,
            line_idle_at: None,
            incoming: VecDeque::new(),
            outgoing: Vec::new(),
            overruns: 0,
        }
    }

    /// Resets the registers; the bytes on the line stay.
    pub fn reset(&mut self) {
        *self = Self {
            incoming: std::mem::take(&mut self.incoming),
            outgoing: std::mem::take(&mut self.outgoing),
            overruns: self.overruns,
            ..Self::new(self.layout)
        };
    }

    /// Returns whether the port is on, and its transmitter or receiver.
    fn is_enabled(&self, part: u32) -> bool {
        let needed = self.layout.enable() | part;
        self.control[0] & needed == needed
    }

    /// Returns the duration of a byte on the line.
    ///
    /// # Panics
    /// If the line does not have the host's format.
    fn byte(&self, clock_hz: u64) -> Picoseconds {
        let unknown: [u32; 3] =
            std::array::from_fn(|it| self.control[it] & !self.layout.known()[it]);
        assert!(
            unknown == [0; 3] && self.baud > 0,
            "the line is not 8N1 with a rate: {unknown:#x?}"
        );
        10 * SECOND * u64::from(self.baud) / clock_hz.max(1)
    }

    fn is_at_hosts_rate(&self, clock_hz: u64) -> bool {
        clock_hz.abs_diff(u64::from(self.baud) * HOST_BAUD) <= clock_hz / 50
    }

    /// Returns what comes of a byte at the other end: another one if the clock has changed since the rate was set.
    fn carried(&self, byte: u8, clock_hz: u64) -> u8 {
        if self.is_at_hosts_rate(clock_hz) {
            byte
        } else {
            !byte
        }
    }

    /// Handles a load.
    pub fn read(&mut self, offset: u32) -> u32 {
        match self.layout.register(offset, true) {
            Register::Flags => {
                self.armed = self.layout == UsartLayout::SharedData;
                self.flags
            }
            Register::Received => {
                self.flags &= !RECEIVED;
                if std::mem::take(&mut self.armed) {
                    self.flags &= !(OVERRUN | FRAMING | IDLE | 5);
                }
                self.received
            }
            Register::Baud => self.baud,
            Register::Control(number) => self.control[number],
            _ => 0,
        }
    }

    /// Handles a store.
    pub fn write(&mut self, offset: u32, value: u32, clock_hz: u64, now: Picoseconds) {
        match self.layout.register(offset, false) {
            Register::Flags if self.layout == UsartLayout::SharedData => {
                self.flags &= value | !(RECEIVED | COMPLETE);
            }
            Register::Clear => {
                self.flags &= !(value & (OVERRUN | FRAMING | IDLE | COMPLETE | 5));
            }
            Register::ToSend if self.is_enabled(TRANSMITTER) => {
                self.send(value as u8, clock_hz, now)
            }
            Register::Baud => {
                let is_on = self.control[0] & self.layout.enable() != 0;
                assert!(
                    self.layout == UsartLayout::SharedData || !is_on,
                    "the rate of a port that is on"
                );
                self.baud = value;
                assert!(self.is_at_hosts_rate(clock_hz), "{clock_hz} Hz / {value}");
            }
            Register::Control(number) => self.control[number] = value,
            Register::Other => assert_eq!(value, 0, "{offset:#x} is not modelled"),
            _ => {}
        }
    }

    fn send(&mut self, byte: u8, clock_hz: u64, now: Picoseconds) {
        self.flags &= !COMPLETE;
        if self.shifting.is_none() {
            self.shifting = Some((byte, now + self.byte(clock_hz)));
        } else {
            self.waiting = Some(byte);
            self.flags &= !EMPTY;
        }
    }

    /// Returns the time of the next event.
    pub fn next_event(&self) -> Picoseconds {
        let receives = self.incoming.front().map(|(at, _)| *at);
        let sends = self.shifting.map(|(_, at)| at);
        [receives, sends, self.line_idle_at]
            .into_iter()
            .flatten()
            .min()
            .unwrap_or(Picoseconds::MAX)
    }

    /// Performs due events.
    pub fn advance(&mut self, clock_hz: u64, now: Picoseconds) {
        if let Some((byte, at)) = self.shifting
            && at <= now
        {
            self.outgoing.push(self.carried(byte, clock_hz));
            self.shifting = self.waiting.take().map(|it| (it, at + self.byte(clock_hz)));
            self.flags |= EMPTY;
            if self.shifting.is_none() {
                self.flags |= COMPLETE;
            }
        }
        if self.line_idle_at.is_some_and(|at| at <= now) {
            self.line_idle_at = None;
            self.flags |= IDLE;
        }
        while let Some((at, byte)) = self.incoming.front().copied()
            && at <= now
        {
            self.incoming.pop_front();
            if !self.is_enabled(RECEIVER) {
                continue;
            }
            let next = self.incoming.front().map(|(at, _)| *at);
            let idle_at = at + self.byte(clock_hz);
            self.line_idle_at = next.is_none_or(|next| next > idle_at).then_some(idle_at);
            if self.flags & RECEIVED != 0 {
                self.flags |= OVERRUN;
                self.overruns += 1;
            } else {
                self.received = self.carried(byte, clock_hz).into();
                self.flags |= RECEIVED;
            }
            // One byte at a time, so that DMA can read it.
            break;
        }
    }

    /// Returns whether DMA should read a byte.
    pub fn wants_reading(&self) -> bool {
        self.control[2] & 1 << 6 != 0 && self.flags & RECEIVED != 0
    }

    /// Returns whether DMA should write a byte.
    pub fn wants_writing(&self) -> bool {
        self.control[2] & 1 << 7 != 0 && self.flags & EMPTY != 0 && self.is_enabled(TRANSMITTER)
    }

    /// Returns a byte to DMA.
    pub fn take(&mut self) -> u8 {
        self.flags &= !RECEIVED;
        self.received as u8
    }

    /// Accepts a byte from DMA.
    pub fn bring(&mut self, byte: u8, clock_hz: u64, now: Picoseconds) {
        self.send(byte, clock_hz, now);
    }

    /// Returns whether the interrupt line is high.
    pub fn interrupts(&self) -> bool {
        let [control, _, third] = self.control;
        let enabled = self.flags & control & (IDLE | RECEIVED | COMPLETE | EMPTY) != 0;
        let overrun = self.flags & OVERRUN != 0 && (control & RECEIVED != 0 || third & 1 != 0);
        enabled || overrun
    }
}

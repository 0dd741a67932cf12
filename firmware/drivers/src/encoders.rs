//! Two ams AS5048A magnetic encoders of 14 bits on one SPI bus in mode 1 (data sheet DS000298).
//!
//! A frame has 16 bits; the answer to a command arrives with the next frame. Every word has even parity.
//! Every answer has a flag that stays set after an error until the error register is read.

use embedded_hal::delay::DelayNs;
use embedded_hal::digital::OutputPin;
use embedded_hal::spi::SpiBus;
use painleve_shared::counts::EncoderCounts;

use crate::{ReadError, rescale};

/// Resolution, bits.
pub const BITS: u8 = 14;

/// Highest clock frequency, Hz.
pub const FASTEST_HZ: u32 = 10_000_000;

/// From select to the first edge, from the last edge to deselect, and between two frames, ns (t_L, t_H,
/// t_CSn).
const SETTLING_NS: u32 = 350;

/// Largest difference of two readings some microseconds apart, counts: 4 counts in 5 µs are 300 rad/s.
const AGREEMENT: u16 = 4;

/// Ticks between two checks of an encoder's magnet.
const DIAGNOSTICS_INTERVAL: u8 = 64;

/// Reads the angle: parity, read bit, address 0x3fff.
const READ_ANGLE: u16 = 0xffff;

/// Reads diagnostics and gain: address 0x3ffd, parity even.
const READ_DIAGNOSTICS: u16 = 0x7ffd;

/// Reads the error register, which clears it and the flag: address 0x0001.
const CLEAR_ERROR: u16 = 0x4001;

const ERROR_FLAG: u16 = 1 << 14;
const DATA: u16 = 0x3fff;

/// Diagnostics of an encoder's magnet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Diagnostics(u16);

impl Diagnostics {
    /// The field is too weak (bit 11) or too strong (10), the angle cannot be computed (9), or the encoder
    /// has not finished its start-up (8 clear).
    pub fn is_healthy(self) -> bool {
        self.0 & 0x0f00 == 0x0100
    }

    /// Automatic gain: 0 for the strongest field, 255 for the weakest.
    pub fn gain(self) -> u8 {
        self.0 as u8
    }
}

/// Two encoders.
pub struct EncoderDriver<B, S, D> {
    bus: B,
    selects: [S; 2],
    delay: D,
    tick: u8,
    diagnostics: [Option<Diagnostics>; 2],
}

impl<B: SpiBus, S: OutputPin, D: DelayNs> EncoderDriver<B, S, D> {
    /// Takes the encoders of θ1 and of the elbow. `selects` are active low and must already be high. The
    /// bus is in mode 1 and no faster than [`FASTEST_HZ`].
    pub fn new(bus: B, selects: [S; 2], delay: D) -> Self {
        Self {
            bus,
            selects,
            delay,
            tick: 0,
            diagnostics: [None; 2],
        }
    }

    /// Reads both angles as counts of `bits` bits. Takes 6 frames, 7 when it also checks a magnet, and 4
    /// more for every encoder that was disturbed.
    pub fn read(&mut self, bits: u8) -> [Result<EncoderCounts, ReadError>; 2] {
        self.tick = (self.tick + 1) % DIAGNOSTICS_INTERVAL;
        [0, 1].map(|encoder| {
            let looks = usize::from(self.tick) == encoder;
            let angle = self.angle(encoder, looks);
            angle.map(|it| EncoderCounts(rescale(it.into(), BITS, bits).cast_unsigned()))
        })
    }

    /// Returns the last diagnostics of the magnets; `None` before the first check.
    pub fn diagnostics(&self) -> [Option<Diagnostics>; 2] {
        self.diagnostics
    }

    fn angle(&mut self, encoder: usize, looks: bool) -> Result<u16, ReadError> {
        self.read_twice(encoder, looks).or_else(|_| {
            // The error register arrives with the next frame; reading it clears it.
            self.frame(encoder, CLEAR_ERROR)?;
            self.read_twice(encoder, false)
        })
    }

    fn read_twice(&mut self, encoder: usize, looks: bool) -> Result<u16, ReadError> {
        self.frame(encoder, READ_ANGLE)?;
        let first = checked(self.frame(encoder, READ_ANGLE)?)?;
        let next = if looks { READ_DIAGNOSTICS } else { READ_ANGLE };
        let second = checked(self.frame(encoder, next)?)?;
        if looks {
            let diagnostics = checked(self.frame(encoder, READ_ANGLE)?)?;
            self.diagnostics[encoder] = Some(Diagnostics(diagnostics));
        }
        let apart = second.wrapping_sub(first) & DATA;
        if apart <= AGREEMENT || apart >= (DATA + 1) - AGREEMENT {
            Ok(second)
        } else {
            Err(ReadError::Disagreement)
        }
    }

    /// Transfers one frame; the answer belongs to the previous command.
    fn frame(&mut self, encoder: usize, command: u16) -> Result<u16, ReadError> {
        let select = &mut self.selects[encoder];
        let mut bytes = command.to_be_bytes();
        select.set_low().map_err(|_| ReadError::Bus)?;
        self.delay.delay_ns(SETTLING_NS);
        let bus = &mut self.bus;
        let done = bus.transfer_in_place(&mut bytes).and_then(|()| bus.flush());
        self.delay.delay_ns(SETTLING_NS);
        select.set_high().map_err(|_| ReadError::Bus)?;
        self.delay.delay_ns(SETTLING_NS);
        done.map_err(|_| ReadError::Bus)?;
        Ok(u16::from_be_bytes(bytes))
    }
}

/// Returns the data of an answer without errors.
fn checked(answer: u16) -> Result<u16, ReadError> {
    if !answer.count_ones().is_multiple_of(2) {
        Err(ReadError::Parity)
    } else if answer & ERROR_FLAG != 0 {
        Err(ReadError::Flagged)
    } else {
        Ok(answer & DATA)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_have_even_parity() {
        for command in [READ_ANGLE, READ_DIAGNOSTICS, CLEAR_ERROR] {
            assert!(command.count_ones().is_multiple_of(2), "{command:#06x}");
        }
    }

    #[test]
    fn an_answer_with_one_flipped_bit_is_rejected() {
        for bit in 0..16 {
            // 0x1234 has five ones; its parity bit is set.
            assert!(checked(0x9234 ^ 1 << bit).is_err());
        }
        assert_eq!(checked(0x9234), Ok(0x1234));
    }

    #[test]
    fn a_magnet_is_healthy_only_after_the_start_and_within_its_field() {
        assert!(Diagnostics(0x0180).is_healthy());
        for ill in [0x0080, 0x0380, 0x0580, 0x0980] {
            assert!(!Diagnostics(ill).is_healthy());
        }
    }
}

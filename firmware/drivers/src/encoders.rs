//! Two ams AS5048A magnetic encoders of 14 bits on one SPI bus in mode 1, or four, two on each joint (data sheet
//! DS000298).
//!
//! A frame has 16 bits; the answer to a command arrives with the next frame. Every word has even parity.
//! Every answer has a flag that stays set after an error until the error register is read.

use painleve_shared::counts::EncoderCounts;
use painleve_shared::mounting::SensorParts;

use crate::exchange::{Dialogue, Exchange, SelectTiming};
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

/// Position in the exchanges with one encoder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    /// The first command is on its way; its answer belongs to an older one.
    Ask,
    First,
    Second,
    Diagnostics,
    /// The error register is being read, which clears it.
    Clear,
}

/// Encoders of both joints on one bus.
#[derive(Clone, Debug)]
pub struct EncoderDriver {
    parts: SensorParts,
    tick: u8,
    /// Whether the magnets are healthy; `None` before their first check. First encoders of both joints, then the second ones.
    magnets: [Option<bool>; 4],
    readings: [Result<u16, ReadError>; 4],
    /// The encoder in turn.
    encoder: usize,
    step: Step,
    first: u16,
    second: u16,
    is_retry: bool,
}

impl EncoderDriver {
    /// Makes the first encoders of θ1 and of the elbow, with selects 0 and 1; the second ones have selects 2 and
    /// 3. The bus is in mode 1 and no faster than [`FASTEST_HZ`].
    pub const fn new() -> Self {
        Self {
            parts: SensorParts::First,
            tick: 0,
            magnets: [None; 4],
            readings: [Err(ReadError::Bus); 4],
            encoder: 0,
            step: Step::Ask,
            first: 0,
            second: 0,
            is_retry: false,
        }
    }

    /// Sets which encoders are read, from the next set of readings on.
    pub fn read_parts(&mut self, parts: SensorParts) {
        *self = Self {
            parts,
            ..Self::new()
        };
    }

    /// Returns both angles of the last set of readings as counts of `bits` bits: those of the second encoders
    /// if only they are read, else those of the first.
    ///
    /// # Errors
    /// [`ReadError`] in place of a reading that is lost for this tick.
    pub fn readings(&self, bits: u8) -> [Result<EncoderCounts, ReadError>; 2] {
        let [first_1, first_2, second_1, second_2] = self.readings;
        let in_use = match self.parts {
            SensorParts::First | SensorParts::Both => [first_1, first_2],
            SensorParts::Second => [second_1, second_2],
        };
        in_use.map(|angle| {
            angle.map(|it| EncoderCounts(rescale(it.into(), BITS, bits).cast_unsigned()))
        })
    }

    /// Returns the angles of the first and of the second encoder of both joints, counts of [`BITS`] bits.
    ///
    /// # Errors
    /// [`ReadError`] in place of a reading that is lost for this tick.
    pub fn pairs(&self) -> [[Result<u16, ReadError>; 2]; 2] {
        let [first_1, first_2, second_1, second_2] = self.readings;
        [[first_1, second_1], [first_2, second_2]]
    }

    /// Returns whether the magnets of all encoders of a joint that are read are healthy, for both joints; `None` until each
    /// has been checked.
    pub fn magnets(&self) -> [Option<bool>; 2] {
        let [first_1, first_2, second_1, second_2] = self.magnets;
        match self.parts {
            SensorParts::First => [first_1, first_2],
            SensorParts::Second => [second_1, second_2],
            // `None` is less than `false`, and that less than `true`.
            SensorParts::Both => [first_1.min(second_1), first_2.min(second_2)],
        }
    }

    /// Returns the first and the last encoder that are read.
    fn ends(&self) -> (usize, usize) {
        match self.parts {
            SensorParts::First => (0, 1),
            SensorParts::Second => (2, 3),
            SensorParts::Both => (0, 3),
        }
    }

    /// Returns whether this encoder's magnet is checked in this set of readings.
    fn looks(&self) -> bool {
        usize::from(self.tick) == self.encoder && !self.is_retry
    }

    fn send(&mut self, step: Step, command: u16) -> Exchange {
        self.step = step;
        Exchange {
            select: self.encoder,
            data: command.into(),
        }
    }

    /// Takes an answer; returns the next step, or the encoder's reading.
    fn step(&mut self, answer: Option<u16>) -> Result<Option<Exchange>, ReadError> {
        let answer = answer.ok_or(ReadError::Bus)?;
        match self.step {
            Step::Ask => return Ok(Some(self.send(Step::First, READ_ANGLE))),
            Step::Clear => return Ok(Some(self.send(Step::Ask, READ_ANGLE))),
            Step::First => {
                self.first = checked(answer)?;
                let command = if self.looks() {
                    READ_DIAGNOSTICS
                } else {
                    READ_ANGLE
                };
                return Ok(Some(self.send(Step::Second, command)));
            }
            Step::Second => {
                self.second = checked(answer)?;
                if self.looks() {
                    return Ok(Some(self.send(Step::Diagnostics, READ_ANGLE)));
                }
            }
            Step::Diagnostics => {
                self.magnets[self.encoder & 3] = Some(is_healthy(checked(answer)?));
            }
        }
        let apart = self.second.wrapping_sub(self.first) & DATA;
        if apart <= AGREEMENT || apart >= (DATA + 1) - AGREEMENT {
            Ok(None)
        } else {
            Err(ReadError::Disagreement)
        }
    }

    /// Stores a reading and turns to the next encoder.
    fn finish(&mut self, reading: Result<u16, ReadError>) -> Option<Exchange> {
        // The mask spares a check of the index.
        self.readings[self.encoder & 3] = reading;
        self.is_retry = false;
        let (_, last) = self.ends();
        if self.encoder >= last {
            return None;
        }
        self.encoder += 1;
        Some(self.send(Step::Ask, READ_ANGLE))
    }
}

impl Default for EncoderDriver {
    fn default() -> Self {
        Self::new()
    }
}

impl Dialogue for EncoderDriver {
    const BITS: u8 = 16;
    const TIMING: SelectTiming = SelectTiming {
        setup_ns: SETTLING_NS,
        hold_ns: SETTLING_NS,
        pause_ns: SETTLING_NS,
    };
    // Four with a magnet's check, or three; then four again after a disturbance.
    const MOST_EXCHANGES: [u32; 2] = [4 + 3 + 2 * 4, 4 + 3 * 3 + 4 * 4];

    fn begin(&mut self) -> Exchange {
        self.tick = (self.tick + 1) % DIAGNOSTICS_INTERVAL;
        (self.encoder, _) = self.ends();
        self.is_retry = false;
        self.readings = [Err(ReadError::Bus); 4];
        self.send(Step::Ask, READ_ANGLE)
    }

    fn proceed(&mut self, answer: Option<u32>) -> Option<Exchange> {
        match self.step(answer.map(|it| it as u16)) {
            Ok(Some(exchange)) => Some(exchange),
            Ok(None) => self.finish(Ok(self.second)),
            Err(disturbance) if self.is_retry => self.finish(Err(disturbance)),
            Err(_) => {
                self.is_retry = true;
                Some(self.send(Step::Clear, CLEAR_ERROR))
            }
        }
    }
}

/// Returns whether a magnet is healthy by its diagnostics: its field is not too weak (bit 11) nor too strong (10), the angle
/// can be computed (9), and the encoder has finished its start-up (8).
fn is_healthy(diagnostics: u16) -> bool {
    diagnostics & 0x0f00 == 0x0100
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
        assert!(is_healthy(0x0180));
        for ill in [0x0080, 0x0380, 0x0580, 0x0980] {
            assert!(!is_healthy(ill));
        }
    }
}

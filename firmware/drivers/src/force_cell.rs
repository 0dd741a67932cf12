//! A Microchip MCP3304 converter (13 bits, signed) behind the bridge amplifiers of a two-axis force cell,
//! SPI mode 0 (data sheet DS21697), and a second one behind a second cell or second bridges on the first.
//!
//! Each axis is a differential pair, the amplifier's output against its ground, with a live zero: without a
//! force, the output is at half the reference. A dead supply, an open or shorted wire and a dead converter
//! therefore give a code that no force gives. The converter runs on 4.5 to 5.5 V: its inputs need a level
//! shifter (74AHCT125), and its output needs a divider to the pin's 3.3 V.

use painleve_shared::counts::ForceCounts;
use painleve_shared::mounting::{Mounting, SensorParts};

use crate::exchange::{Dialogue, Exchange, SelectTiming};
use crate::{ReadError, rescale};

/// Resolution over the forces of both signs, bits. The converter's thirteenth bit is the sign of its pair's
/// voltage, which is never negative.
pub const BITS: u8 = 12;

/// Code without a force, if the bridge is in balance: half the reference.
pub const LIVE_ZERO: i32 = 1 << (BITS - 1);

/// Highest clock frequency at 5 V, Hz.
pub const FASTEST_HZ: u32 = 2_100_000;

/// Select high between two conversions, ns (t_CSH).
const PAUSE_NS: u32 = 475;

/// From select to the first clock edge, ns (t_SUCS).
const SETUP_NS: u32 = 100;

/// Largest difference of two conversions of one force, counts: the converter's noise.
const AGREEMENT: i32 = 2;

/// Start bit, differential.
const CONVERT: u32 = 0b0000_1000;

/// The bit before the sign is always 0.
const NULL_BIT: u32 = 1 << 13;

/// A force cell, or two.
#[derive(Clone, Debug)]
pub struct ForceCellDriver {
    parts: SensorParts,
    /// Normal and tangential force of the first converter, then of the second.
    readings: [Result<i32, ReadError>; 4],
    /// The conversion in turn: an index of the readings.
    turn: usize,
    /// Conversions of this force.
    conversions: [Result<i32, ReadError>; 2],
    count: usize,
}

/// Readings of both forces; [`ReadError`] in place of one that is lost for this tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ForceReadings {
    /// f_t, along the belt.
    pub tangential: Result<ForceCounts, ReadError>,
    /// f_n, across it.
    pub normal: Result<ForceCounts, ReadError>,
}

impl ForceCellDriver {
    /// Makes the first force cell, in mode 0, no faster than [`FASTEST_HZ`], with select 0: f_n on channels 0 (+)
    /// and 1 (−), f_t on 2 (+) and 3 (−). The second has select 1.
    pub const fn new() -> Self {
        Self {
            parts: SensorParts::First,
            readings: [Err(ReadError::Bus); 4],
            turn: 0,
            conversions: [Err(ReadError::Bus); 2],
            count: 0,
        }
    }

    /// Sets which converters are read, from the next set of readings on.
    pub fn read_parts(&mut self, parts: SensorParts) {
        *self = Self {
            parts,
            ..Self::new()
        };
    }

    /// Returns the last set of readings, from the live zero, as counts of `bits` bits: those of the
    /// second converter if only that is read, else those of the first. Each force takes two conversions, and a
    /// third if these two disagree. A code outside the range that `mounting` allows is no reading.
    pub fn readings(&self, bits: u8, mounting: &Mounting) -> ForceReadings {
        let [first_n, first_t, second_n, second_t] = self.readings;
        let (tangential, normal) = match self.parts {
            SensorParts::First | SensorParts::Both => (first_t, first_n),
            SensorParts::Second => (second_t, second_n),
        };
        let scaled = |reading| {
            let force = from_live_zero(reading, mounting)?;
            Ok(ForceCounts(rescale(force, BITS, bits)))
        };
        ForceReadings {
            tangential: scaled(tangential),
            normal: scaled(normal),
        }
    }

    /// Returns f_t and f_n, each by the first and by the second converter, from the live zero, in counts of
    /// [`BITS`] bits.
    ///
    /// # Errors
    /// [`ReadError`] in place of a reading that is lost for this tick.
    pub fn pairs(&self, mounting: &Mounting) -> [[Result<i32, ReadError>; 2]; 2] {
        let [first_n, first_t, second_n, second_t] = self.readings;
        [[first_t, second_t], [first_n, second_n]]
            .map(|pair| pair.map(|reading| from_live_zero(reading, mounting)))
    }

    /// Returns the first and the last conversion of a set of readings.
    fn ends(&self) -> (usize, usize) {
        match self.parts {
            SensorParts::First => (0, 1),
            SensorParts::Second => (2, 3),
            SensorParts::Both => (0, 3),
        }
    }

    fn convert(&self) -> Exchange {
        Exchange {
            select: self.turn >> 1,
            // The upper two channel bits follow the start bit; the third begins the second byte.
            data: (CONVERT | (self.turn as u32 & 1)) << 16,
        }
    }

    /// Returns the force's reading once its conversions suffice.
    fn reading(&mut self, conversion: Result<i32, ReadError>) -> Option<Result<i32, ReadError>> {
        if let Some(place) = self.conversions.get_mut(self.count) {
            *place = conversion;
            self.count += 1;
            let [first, second] = self.conversions;
            return (self.count == 2 && first == second).then_some(first);
        }
        Some(median_of_agreeing(self.conversions, conversion))
    }
}

/// Returns the median of three conversions if two of them agree.
fn median_of_agreeing(
    [first, second]: [Result<i32, ReadError>; 2],
    third: Result<i32, ReadError>,
) -> Result<i32, ReadError> {
    match (first, second, third?) {
        (Ok(one), Ok(two), three) => {
            let [low, median, high] = sorted([one, two, three]);
            let is_agreed = (median - low).min(high - median) <= AGREEMENT;
            is_agreed.then_some(median).ok_or(ReadError::Disagreement)
        }
        (Ok(one), Err(_), two) | (Err(_), Ok(one), two) if one == two => Ok(two),
        _ => Err(ReadError::Disagreement),
    }
}

/// Returns a reading from the live zero, unless no force gives its code.
fn from_live_zero(reading: Result<i32, ReadError>, mounting: &Mounting) -> Result<i32, ReadError> {
    let code = reading?;
    (mounting.force_lowest_code.into()..=mounting.force_highest_code.into())
        .contains(&code)
        .then_some(code - LIVE_ZERO)
        .ok_or(ReadError::Implausible)
}

/// Returns the signed conversion in an answer.
fn decoded(answer: Option<u32>) -> Result<i32, ReadError> {
    let answer = answer.ok_or(ReadError::Bus)?;
    if answer & NULL_BIT != 0 {
        return Err(ReadError::NotZero);
    }
    // Extends the sign of 13 bits.
    Ok((answer << 19).cast_signed() >> 19)
}

impl Default for ForceCellDriver {
    fn default() -> Self {
        Self::new()
    }
}

impl Dialogue for ForceCellDriver {
    const BITS: u8 = 24;
    const TIMING: SelectTiming = SelectTiming {
        setup_ns: SETUP_NS,
        hold_ns: 0,
        pause_ns: PAUSE_NS,
    };
    const MOST_EXCHANGES: [u32; 2] = [6, 12];

    fn begin(&mut self) -> Exchange {
        self.read_parts(self.parts);
        (self.turn, _) = self.ends();
        self.convert()
    }

    fn proceed(&mut self, answer: Option<u32>) -> Option<Exchange> {
        if let Some(reading) = self.reading(decoded(answer)) {
            // The mask spares a check of the index.
            self.readings[self.turn & 3] = reading;
            let (_, last) = self.ends();
            if self.turn >= last {
                return None;
            }
            self.turn += 1;
            self.count = 0;
        }
        Some(self.convert())
    }
}

fn sorted(mut values: [i32; 3]) -> [i32; 3] {
    values.sort_unstable();
    values
}

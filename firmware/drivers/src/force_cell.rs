//! A Microchip MCP3304 converter (13 bits, signed) behind the bridge amplifiers of a two-axis force cell,
//! SPI mode 0 (data sheet DS21697).
//!
//! Each axis is a differential pair, the amplifier's output against its ground, with a live zero: without a
//! force, the output is at half the reference. A dead supply, an open or shorted wire and a dead converter
//! therefore give a code that no force gives. The converter runs on 4.5 to 5.5 V: its inputs need a level
//! shifter (74AHCT125), and its output needs a pin that tolerates 5 V.

use painleve_shared::counts::ForceCounts;
use painleve_shared::mounting::Mounting;

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

/// A force cell.
#[derive(Clone, Debug)]
pub struct ForceCellDriver {
    /// Normal and tangential force.
    readings: [Result<i32, ReadError>; 2],
    /// The pair of channels in turn.
    pair: usize,
    /// Conversions of this pair.
    conversions: [Result<i32, ReadError>; 2],
    count: usize,
}

impl ForceCellDriver {
    /// Makes a force cell, in mode 0, no faster than [`FASTEST_HZ`], with select 0: f_n on channels 0 (+)
    /// and 1 (−), f_t on 2 (+) and 3 (−).
    pub const fn new() -> Self {
        Self {
            readings: [Err(ReadError::Bus); 2],
            pair: 0,
            conversions: [Err(ReadError::Bus); 2],
            count: 0,
        }
    }

    /// Returns (f_t, f_n) of the last set of readings, from the live zero, as counts of `bits` bits. Each
    /// force takes two conversions, and a third if these two disagree. A code outside the range that
    /// `mounting` allows is no reading.
    pub fn readings(
        &self,
        bits: u8,
        mounting: &Mounting,
    ) -> (
        Result<ForceCounts, ReadError>,
        Result<ForceCounts, ReadError>,
    ) {
        let plausible = mounting.force_lowest_code.into()..=mounting.force_highest_code.into();
        let [normal, tangential] = self.readings.map(|reading| {
            let code = reading?;
            let force = ForceCounts(rescale(code - LIVE_ZERO, BITS, bits));
            plausible
                .contains(&code)
                .then_some(force)
                .ok_or(ReadError::Implausible)
        });
        (tangential, normal)
    }

    fn convert(&self) -> Exchange {
        Exchange {
            select: 0,
            // The upper two channel bits follow the start bit; the third begins the second byte.
            data: (CONVERT | self.pair as u32) << 16,
        }
    }

    /// Returns the pair's reading once its conversions suffice.
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
    const MOST_EXCHANGES: u32 = 6;

    fn begin(&mut self) -> Exchange {
        *self = Self::new();
        self.convert()
    }

    fn proceed(&mut self, answer: Option<u32>) -> Option<Exchange> {
        if let Some(reading) = self.reading(decoded(answer)) {
            // The mask spares a check of the index.
            self.readings[self.pair & 1] = reading;
            if self.pair == 1 {
                return None;
            }
            self.pair = 1;
            self.count = 0;
        }
        Some(self.convert())
    }
}

fn sorted(mut values: [i32; 3]) -> [i32; 3] {
    values.sort_unstable();
    values
}

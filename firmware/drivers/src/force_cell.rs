//! A Microchip MCP3304 converter (13 bits, signed) behind the bridge amplifiers of a two-axis force cell,
//! SPI mode 0 (data sheet DS21697).
//!
//! Each axis is a differential pair, the amplifier's output against its reference, so that forces of either
//! sign are read; single-ended, the converter has no sign. The converter runs on 4.5 to 5.5 V: its inputs
//! need a level shifter (74AHCT125), and its output needs a pin that tolerates 5 V.

use embedded_hal::delay::DelayNs;
use embedded_hal::digital::{self, OutputPin};
use embedded_hal::spi::SpiDevice;
use painleve_shared::counts::ForceCounts;

use crate::{ReadError, rescale};

/// Resolution, bits.
pub const BITS: u8 = 13;

/// Highest clock frequency at 5 V, Hz.
pub const FASTEST_HZ: u32 = 2_100_000;

/// Select high between two conversions, ns (t_CSH).
const PAUSE_NS: u32 = 475;

/// From select to the first clock edge, ns (t_SUCS).
const SETUP_NS: u32 = 100;

/// Largest difference of two conversions of one force, counts: the converter's noise.
const AGREEMENT: i32 = 2;

/// Start bit, differential.
const CONVERT: u8 = 0b0000_1000;

/// The bit before the sign is always 0.
const NULL_BIT: u8 = 0b0010_0000;

/// The converter's select pin, with the pauses that the data sheet requires.
pub struct PausedSelect<S, D> {
    pin: S,
    delay: D,
}

impl<S: OutputPin, D: DelayNs> PausedSelect<S, D> {
    /// Takes a pin that is already high.
    pub fn new(pin: S, delay: D) -> Self {
        Self { pin, delay }
    }
}

impl<S: OutputPin, D> digital::ErrorType for PausedSelect<S, D> {
    type Error = S::Error;
}

impl<S: OutputPin, D: DelayNs> OutputPin for PausedSelect<S, D> {
    fn set_low(&mut self) -> Result<(), S::Error> {
        self.pin.set_low()?;
        self.delay.delay_ns(SETUP_NS);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), S::Error> {
        self.pin.set_high()?;
        self.delay.delay_ns(PAUSE_NS);
        Ok(())
    }
}

/// A force cell.
pub struct ForceCellDriver<D> {
    device: D,
}

impl<D: SpiDevice> ForceCellDriver<D> {
    /// Makes a force cell on this device, in mode 0, no faster than [`FASTEST_HZ`], selected through
    /// [`PausedSelect`].
    pub fn new(device: D) -> Self {
        Self { device }
    }

    /// Reads (f_t, f_n) as counts of `bits` bits: f_n on channels 0 (+) and 1 (−), f_t on 2 (+) and 3 (−).
    /// Each force takes two conversions, and a third if these two disagree.
    pub fn read(
        &mut self,
        bits: u8,
    ) -> (
        Result<ForceCounts, ReadError>,
        Result<ForceCounts, ReadError>,
    ) {
        let [normal, tangential] = [0, 1].map(|pair| {
            let counts = self.two_of_three(pair);
            counts.map(|it| ForceCounts(rescale(it, BITS, bits)))
        });
        (tangential, normal)
    }

    /// Returns two conversions that agree, or the median of three if two of these agree.
    fn two_of_three(&mut self, pair: u8) -> Result<i32, ReadError> {
        let first = self.convert(pair);
        let second = self.convert(pair);
        if first == second {
            return first;
        }
        match (first, second, self.convert(pair)?) {
            (Ok(one), Ok(two), three) => {
                let [low, median, high] = sorted([one, two, three]);
                let is_agreed = (median - low).min(high - median) <= AGREEMENT;
                is_agreed.then_some(median).ok_or(ReadError::Disagreement)
            }
            (Ok(one), Err(_), two) | (Err(_), Ok(one), two) if one == two => Ok(two),
            _ => Err(ReadError::Disagreement),
        }
    }

    fn convert(&mut self, pair: u8) -> Result<i32, ReadError> {
        // The upper two channel bits follow the start bit; the third begins the second byte.
        let mut bytes = [CONVERT | pair, 0, 0];
        let done = self.device.transfer_in_place(&mut bytes);
        done.map_err(|_| ReadError::Bus)?;
        let [_, high, low] = bytes;
        if high & NULL_BIT != 0 {
            return Err(ReadError::NotZero);
        }
        let word = u16::from_be_bytes([high & 0x1f, low]);
        // Extends the sign of 13 bits.
        Ok(i32::from((word << 3).cast_signed() >> 3))
    }
}

fn sorted(mut values: [i32; 3]) -> [i32; 3] {
    values.sort_unstable();
    values
}

//! The arm's sensors, through `embedded-hal`: any SPI bus will do.
//!
//! Encoders: two AS5048A (14 bits, absolute) on one bus in mode 1, θ1 and the
//! elbow. Force cell: bridge amplifiers on channels 0 (f_n) and 1 (f_t) of a MCP3304
//! (13 bits, signed) in mode 0. Every transfer has a fixed length.

use embedded_hal::digital::OutputPin;
use embedded_hal::spi::{SpiBus, SpiDevice};
use painleve_shared::counts::{EncoderCounts, ForceCounts};

/// Read the angle register: parity, read bit, address 0x3fff.
const READ_ANGLE: [u8; 2] = [0xff, 0xff];

/// What a sensor that does not answer properly reads: out of every range, so that the controller
/// shuts down.
const BROKEN: u32 = u32::MAX;

/// Two AS5048A encoders.
pub struct Encoders<BUS, SELECT> {
    /// The bus they share.
    pub bus: BUS,
    /// Their select pins, low for selected.
    pub selects: [SELECT; 2],
}

impl<BUS: SpiBus, SELECT: OutputPin> Encoders<BUS, SELECT> {
    /// Reads both angles.
    pub fn read(&mut self) -> [EncoderCounts; 2] {
        let Self { bus, selects } = self;
        selects.each_mut().map(|select| {
            // The answer to a command comes with the next one.
            let _ = transfer(bus, select, READ_ANGLE);
            let answer = transfer(bus, select, READ_ANGLE).map(u16::from_be_bytes);
            EncoderCounts(answer.map_or(BROKEN, angle_counts))
        })
    }
}

fn transfer<BUS: SpiBus, SELECT: OutputPin>(
    bus: &mut BUS,
    select: &mut SELECT,
    mut bytes: [u8; 2],
) -> Option<[u8; 2]> {
    select.set_low().ok()?;
    let done = bus.transfer_in_place(&mut bytes).and_then(|()| bus.flush());
    select.set_high().ok()?;
    done.ok().map(|()| bytes)
}

/// 14 bits of angle below an error flag and even parity.
fn angle_counts(word: u16) -> u32 {
    let error = word & 0x4000 != 0;
    if error || !word.count_ones().is_multiple_of(2) {
        BROKEN
    } else {
        u32::from(word & 0x3fff)
    }
}

/// A MCP3304 behind the force cell.
pub struct ForceCell<D>(pub D);

impl<D: SpiDevice> ForceCell<D> {
    /// Reads (f_t, f_n).
    pub fn read(&mut self) -> (ForceCounts, ForceCounts) {
        (self.channel(1), self.channel(0))
    }

    fn channel(&mut self, channel: u8) -> ForceCounts {
        // Start bit, single-ended, three bits of channel; the answer has a sign and 12 bits.
        let mut bytes = [0b0000_1100 | channel >> 1, channel << 7, 0];
        match self.0.transfer_in_place(&mut bytes) {
            Ok(()) => {
                let word = u16::from_be_bytes([bytes[1] & 0x1f, bytes[2]]);
                ForceCounts(i32::from((word << 3) as i16 >> 3))
            }
            Err(_) => ForceCounts(i32::MAX),
        }
    }
}

//! Messages as bytes, for links that are not shared memory.
//!
//! A message is encoded by postcard, followed by its CRC-32 (ISO-HDLC), and framed by
//! COBS: it contains no zero byte and ends with one, so that a receiver that
//! lost its place finds the next message.

use crc::{CRC_32_ISO_HDLC, Crc, Digest, Table};
use postcard::ser_flavors::{Cobs, Slice, crc::CrcModifier};
use serde::{Deserialize, Serialize};

/// The smallest table there is: 256 entries of 4 bytes.
static CRC: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISO_HDLC);

/// Why bytes are not a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum WireError {
    /// The buffer is too small for the message.
    BufferTooSmall,
    /// Framing, checksum or content is wrong.
    Corrupt,
}

impl core::fmt::Display for WireError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            WireError::BufferTooSmall => "the buffer is too small for the message",
            WireError::Corrupt => "framing, checksum or content of the message is wrong",
        })
    }
}

impl core::error::Error for WireError {}

fn digest() -> Digest<'static, u32, Table<1>> {
    CRC.digest()
}

/// Encodes `message` into `buffer`; returns the bytes to send, the closing zero included.
///
/// # Errors
/// [`WireError::BufferTooSmall`].
pub fn encode<'a, M: Serialize>(message: &M, buffer: &'a mut [u8]) -> Result<&'a [u8], WireError> {
    let framed = Cobs::try_new(Slice::new(buffer)).map_err(|_| WireError::BufferTooSmall)?;
    postcard::serialize_with_flavor(message, CrcModifier::new(framed, digest()))
        .map(|bytes| &*bytes)
        .map_err(|_| WireError::BufferTooSmall)
}

/// Decodes one message from the bytes up to and without its closing zero; uses
/// `bytes` as scratch.
///
/// # Errors
/// [`WireError::Corrupt`] for anything that `encode` did not make.
pub fn decode<M: for<'de> Deserialize<'de>>(bytes: &mut [u8]) -> Result<M, WireError> {
    let length = cobs::decode_in_place(bytes).map_err(|_| WireError::Corrupt)?;
    let content = bytes.get(..length).ok_or(WireError::Corrupt)?;
    postcard::from_bytes_crc32(content, digest()).map_err(|_| WireError::Corrupt)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::counts::{EncoderCounts, ForceCounts};
    use crate::frame::SensorFrame;
    use proptest::prelude::*;
    use std::vec::Vec;

    prop_compose! {
        fn sensor_frame()(tick: u32, sequence: u32, j1: u32, j2: u32, n: i32, t: i32) -> SensorFrame {
            SensorFrame {
                tick, sequence,
                joints: [EncoderCounts(j1), EncoderCounts(j2)],
                normal_force: ForceCounts(n),
                tangential_force: ForceCounts(t),
                ..Default::default()
            }
        }
    }

    fn encoded(frame: &SensorFrame) -> Vec<u8> {
        let mut buffer = [0; 64];
        encode(frame, &mut buffer).unwrap().to_vec()
    }

    proptest! {
        #[test]
        fn frames_round_trip_and_hold_no_inner_zero(frame in sensor_frame()) {
            let mut bytes = encoded(&frame);
            prop_assert_eq!(bytes.pop(), Some(0));
            prop_assert!(!bytes.contains(&0));
            prop_assert_eq!(decode::<SensorFrame>(&mut bytes), Ok(frame));
        }

        #[test]
        fn one_flipped_bit_is_noticed(frame in sensor_frame(), at in 0_usize..1000, bit in 0_u8..8) {
            let mut bytes = encoded(&frame);
            bytes.pop();
            let at = at % bytes.len();
            bytes[at] ^= 1 << bit;
            prop_assert_eq!(decode::<SensorFrame>(&mut bytes), Err(WireError::Corrupt));
        }
    }

    #[test]
    fn a_small_buffer_is_an_error_and_not_a_panic() {
        let frame = SensorFrame::default();
        for size in 0..12 {
            assert_eq!(
                encode(&frame, &mut [0; 16][..size]),
                Err(WireError::BufferTooSmall)
            );
        }
        assert!(decode::<SensorFrame>(&mut []).is_err());
    }
}

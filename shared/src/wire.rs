//! Encodes messages as bytes, for links other than shared memory.
//!
//! A message is encoded by postcard, followed by its CRC-32 (ISO-HDLC), and framed by COBS. A frame
//! contains no zero byte except the last, so a receiver that has lost synchronisation finds the
//! next message.

use crc::{CRC_32_ISO_HDLC, Crc, Digest, Table};
use postcard::ser_flavors::{Cobs, Slice, crc::CrcModifier};
use serde::{Deserialize, Serialize};

use crate::message::MAXIMUM_LENGTH;

/// The smallest table available: 256 entries of 4 bytes.
static CRC: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISO_HDLC);

/// Length of the checksum that follows a message, bytes.
const CHECKSUM_LENGTH: usize = 4;

/// Why bytes cannot be decoded as a message, or a message cannot be encoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum WireError {
    /// The buffer is too small for the message.
    BufferTooSmall,
    /// The bytes are not a valid frame: noise, or a truncated or overlong message.
    Garbage,
    /// A frame whose checksum is wrong.
    Checksum,
    /// The frame arrived intact but its content is unknown to this version.
    Content,
}

impl core::fmt::Display for WireError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            WireError::BufferTooSmall => "the buffer is too small for the message",
            WireError::Garbage => "the bytes are not framed as a message",
            WireError::Checksum => "the checksum of the message is wrong",
            WireError::Content => "the message is of an unknown kind",
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

/// Decodes one message from the bytes before its closing zero; uses `bytes` as scratch space.
///
/// # Errors
/// [`WireError::Garbage`], [`WireError::Checksum`] or [`WireError::Content`] for
/// anything that `encode` did not make.
pub fn decode<'a, M: Deserialize<'a>>(bytes: &'a mut [u8]) -> Result<M, WireError> {
    let length = cobs::decode_in_place(bytes).map_err(|_| WireError::Garbage)?;
    let framed = bytes.get(..length).ok_or(WireError::Garbage)?;
    let (content, checksum) = framed
        .split_last_chunk::<CHECKSUM_LENGTH>()
        .ok_or(WireError::Garbage)?;
    if CRC.checksum(content) != u32::from_le_bytes(*checksum) {
        return Err(WireError::Checksum);
    }
    postcard::from_bytes(content).map_err(|_| WireError::Content)
}

/// Collects bytes up to the zero that ends a message; resynchronises after garbage.
#[derive(Clone, Debug)]
pub struct Inbox {
    bytes: [u8; MAXIMUM_LENGTH],
    length: usize,
    /// Whether the present message exceeds the longest length; the rest of it is skipped.
    overlong: bool,
}

impl Default for Inbox {
    fn default() -> Self {
        Self::new()
    }
}

impl Inbox {
    /// An empty inbox.
    pub const fn new() -> Self {
        Self {
            bytes: [0; MAXIMUM_LENGTH],
            length: 0,
            overlong: false,
        }
    }

    /// Takes one byte; returns a message, without its closing zero, when it is complete. An
    /// overlong message is returned empty, which decodes as [`WireError::Garbage`].
    pub fn push(&mut self, byte: u8) -> Option<&mut [u8]> {
        if byte != 0 {
            match self.bytes.get_mut(self.length) {
                Some(place) => {
                    *place = byte;
                    self.length += 1;
                }
                None => self.overlong = true,
            }
            return None;
        }
        let length = core::mem::take(&mut self.length);
        let overlong = core::mem::take(&mut self.overlong);
        // An empty frame is not a message: senders put a zero in front to force a fresh start.
        if length == 0 {
            return None;
        }
        self.bytes.get_mut(..if overlong { 0 } else { length })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::counts::{EncoderCounts, ForceCounts};
    use crate::frame::SensorFrame;
    use crate::message::{Request, Response};
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

    fn requested(frame: &SensorFrame) -> Vec<u8> {
        let mut buffer = [0; 64];
        encode(&Request::Sensor(*frame), &mut buffer)
            .unwrap()
            .to_vec()
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
        fn one_flipped_bit_is_detected(frame in sensor_frame(), at in 0_usize..1000, bit in 0_u8..8) {
            let mut bytes = encoded(&frame);
            bytes.pop();
            let at = at % bytes.len();
            bytes[at] ^= 1 << bit;
            let decoded = decode::<SensorFrame>(&mut bytes);
            prop_assert!(
                matches!(decoded, Err(WireError::Garbage | WireError::Checksum)),
                "{:?}", decoded
            );
        }
    }

    proptest! {
        /// Random bytes, and messages with random bytes in them: the inbox finds the ends, the
        /// decoder refuses or returns a message, and afterwards an intact message arrives.
        #[test]
        fn any_bytes_are_refused_or_decoded(
            stream in prop::collection::vec(
                prop_oneof![
                    3 => prop::collection::vec(any::<u8>(), 0..40),
                    1 => prop::collection::vec(any::<u8>(), 0..2 * MAXIMUM_LENGTH),
                    3 => (sensor_frame(), any::<prop::sample::Index>(), any::<u8>()).prop_map(
                        |(frame, at, byte)| {
                            let mut bytes = requested(&frame);
                            let at = at.index(bytes.len());
                            bytes[at] = byte;
                            bytes
                        },
                    ),
                ],
                0..12,
            ),
            frame in sensor_frame(),
        ) {
            let mut inbox = Inbox::new();
            for byte in stream.concat() {
                if let Some(message) = inbox.push(byte) {
                    prop_assert!(message.len() <= MAXIMUM_LENGTH);
                    let _ = decode::<Response>(&mut message.to_vec());
                    let _ = decode::<Request>(message);
                }
            }
            let mut last = None;
            for byte in [std::vec![0], requested(&frame)].concat() {
                if let Some(message) = inbox.push(byte) {
                    last = Some(decode::<Request>(message) == Ok(Request::Sensor(frame)));
                }
            }
            prop_assert_eq!(last, Some(true));
        }
    }

    #[test]
    fn a_small_buffer_is_an_error() {
        let frame = SensorFrame::default();
        for size in 0..12 {
            assert_eq!(
                encode(&frame, &mut [0; 16][..size]),
                Err(WireError::BufferTooSmall)
            );
        }
        assert!(decode::<SensorFrame>(&mut []).is_err());
    }

    #[test]
    fn unknown_and_damaged_messages_are_different_errors() {
        let mut buffer = [0; 16];
        let length = encode(&(1_u8, 2_u8), &mut buffer).unwrap().len();
        let bytes = &mut buffer[..length - 1];
        assert_eq!(
            decode::<(u32, u32, u32)>(&mut bytes.to_vec()),
            Err(WireError::Content)
        );
        bytes[2] ^= 1;
        assert_eq!(decode::<(u8, u8)>(bytes), Err(WireError::Checksum));
    }

    #[test]
    fn messages_are_found_again_after_garbage() {
        let frame = SensorFrame {
            tick: 7,
            ..Default::default()
        };
        let good = encoded(&frame);
        let mut stream = std::vec![9, 9, 9];
        stream.extend(&good);
        stream.extend([1; 2 * MAXIMUM_LENGTH]);
        stream.push(0);
        stream.extend(&good);
        let mut inbox = Inbox::new();
        let mut results = Vec::new();
        for byte in stream {
            if let Some(message) = inbox.push(byte) {
                results.push(decode::<SensorFrame>(message));
            }
        }
        // The garbage before it destroys the first good message.
        assert!(matches!(
            results[..],
            [Err(_), Err(WireError::Garbage), Ok(found)] if found == frame
        ));
    }
}

//! Bytes from the host, put together to messages.

use painleve_shared::message::MAXIMUM_LENGTH;

/// Collects bytes up to the zero that ends a message.
pub struct Inbox {
    bytes: [u8; MAXIMUM_LENGTH],
    length: usize,
    /// The message is longer than any: its rest is skipped.
    overlong: bool,
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

    /// Takes in one byte; returns a message, without its closing zero, when it is complete. An
    /// overlong one comes out empty, which no decoder accepts.
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
        self.bytes.get_mut(..if overlong { 0 } else { length })
    }
}

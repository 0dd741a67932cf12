//! The board's memory for a configuration of its own.

use embedded_storage::nor_flash::NorFlash;
use painleve_drivers::slots::{Content, NotWritten, Slots};
use painleve_shared::message::MAXIMUM_LENGTH;

/// Keeps a configuration over a loss of power, in the flash of a board; with room for a copy of its content.
pub struct FlashMemory<F> {
    slots: Slots<F>,
    buffer: [u8; MAXIMUM_LENGTH],
}

impl<F: NorFlash> FlashMemory<F> {
    /// Takes ownership of the flash, of two equal slots.
    pub fn new(flash: F) -> Self {
        Self {
            slots: Slots::new(flash),
            buffer: [0; MAXIMUM_LENGTH],
        }
    }

    /// Returns the newest intact configuration, encoded by postcard.
    pub fn newest(&mut self) -> Option<(Content, &[u8])> {
        let content = self.slots.newest(&mut self.buffer)?;
        Some((content, self.buffer.get(..content.length)?))
    }

    /// Stores a configuration of a build; returns its version.
    ///
    /// # Errors
    /// [`NotWritten`]; the last configuration is then still there.
    pub fn store(&mut self, build: u64, configuration: &[u8]) -> Result<u32, NotWritten> {
        self.slots.store(build, configuration, &mut self.buffer)
    }

    /// Erases every configuration.
    ///
    /// # Errors
    /// [`NotWritten`].
    pub fn forget(&mut self) -> Result<(), NotWritten> {
        self.slots.forget(&mut self.buffer)
    }
}

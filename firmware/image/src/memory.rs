//! The board's memory for a configuration of its own.

use embedded_storage::nor_flash::NorFlash;
use painleve_drivers::slots::{Content, NotWritten, Slots};
use painleve_shared::message::MAXIMUM_LENGTH;

/// Keeps a configuration over a loss of power.
pub trait ConfigurationMemory {
    /// Whether the board has one.
    const IS_THERE: bool;

    /// Returns the newest intact configuration, encoded by postcard.
    fn newest(&mut self) -> Option<(Content, &[u8])>;

    /// Stores a configuration of a build; returns its version.
    ///
    /// # Errors
    /// [`NotWritten`]; the last configuration is then still there.
    fn store(&mut self, build: u64, configuration: &[u8]) -> Result<u32, NotWritten>;

    /// Erases every configuration.
    ///
    /// # Errors
    /// [`NotWritten`].
    fn forget(&mut self) -> Result<(), NotWritten>;
}

/// Flash of a board, with room for a copy of its content.
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
}

impl<F: NorFlash> ConfigurationMemory for FlashMemory<F> {
    const IS_THERE: bool = true;

    fn newest(&mut self) -> Option<(Content, &[u8])> {
        let content = self.slots.newest(&mut self.buffer)?;
        Some((content, self.buffer.get(..content.length)?))
    }

    fn store(&mut self, build: u64, configuration: &[u8]) -> Result<u32, NotWritten> {
        self.slots.store(build, configuration, &mut self.buffer)
    }

    fn forget(&mut self) -> Result<(), NotWritten> {
        self.slots.forget(&mut self.buffer)
    }
}

/// A board without such a memory.
pub struct NoMemory;

impl ConfigurationMemory for NoMemory {
    const IS_THERE: bool = false;

    fn newest(&mut self) -> Option<(Content, &[u8])> {
        None
    }

    fn store(&mut self, _: u64, _: &[u8]) -> Result<u32, NotWritten> {
        Err(NotWritten)
    }

    fn forget(&mut self) -> Result<(), NotWritten> {
        Err(NotWritten)
    }
}

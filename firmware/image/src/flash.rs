//! Sectors of an STM32's own flash as slots for configurations: erasing, writing and reading, which are the same
//! on every family. A chip provides its registers.

#![allow(unsafe_code)] // memory-mapped flash

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash, check_erase, check_read, check_write,
};

/// The registers of a chip's flash, and where its slots are.
pub trait FlashRegisters {
    /// Address of the slots, which the board's `memory.x` keeps free of program.
    const START: u32;

    /// Number of the first of their two sectors.
    const FIRST_SECTOR: u8;

    /// Length of a sector, bytes.
    const SECTOR: usize;

    /// Bytes that are written at once.
    const WORD: usize;

    /// Opens the control register.
    ///
    /// # Errors
    /// [`NorFlashErrorKind`] if the flash is not as expected, or an earlier operation has failed.
    fn open(&mut self) -> Result<(), NorFlashErrorKind>;

    /// Closes the control register, and empties the data cache, which may hold what was there before.
    fn close(&mut self);

    /// Starts to erase a sector.
    fn erase(&mut self, sector: u8);

    /// Permits to write.
    fn permit_writing(&mut self);

    /// Waits for the end of an operation, and takes its errors.
    ///
    /// # Errors
    /// [`NorFlashErrorKind`] if it has failed, or takes too long.
    fn wait(&mut self) -> Result<(), NorFlashErrorKind>;

    /// Carries out `read`, which reads the slots.
    fn reading(&mut self, read: impl FnOnce()) {
        read();
    }
}

/// The slots.
pub struct ConfigurationFlash<R>(R);

impl<R: FlashRegisters> ConfigurationFlash<R> {
    /// Takes ownership of the flash's registers.
    pub fn new(registers: R) -> Self {
        Self(registers)
    }

    /// Opens the control register, carries out the change, and closes the register.
    fn change(
        &mut self,
        change: impl FnOnce(&mut R) -> Result<(), NorFlashErrorKind>,
    ) -> Result<(), NorFlashErrorKind> {
        self.0.open()?;
        let result = change(&mut self.0);
        self.0.close();
        result
    }
}

impl<R> ErrorType for ConfigurationFlash<R> {
    type Error = NorFlashErrorKind;
}

impl<R: FlashRegisters> ReadNorFlash for ConfigurationFlash<R> {
    const READ_SIZE: usize = 1;

    #[inline(never)]
    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        check_read(self, offset, bytes.len())?;
        self.0.reading(|| {
            for (address, byte) in (R::START + offset..).zip(bytes) {
                // SAFETY: `check_read` has found the address within the slots, which are mapped to memory.
                *byte = unsafe { (address as *const u8).read_volatile() };
            }
        });
        Ok(())
    }

    fn capacity(&self) -> usize {
        2 * R::SECTOR
    }
}

impl<R: FlashRegisters> NorFlash for ConfigurationFlash<R> {
    const WRITE_SIZE: usize = R::WORD;
    const ERASE_SIZE: usize = R::SECTOR;

    #[inline(never)]
    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        check_erase(self, from, to)?;
        let [first, end] = [from, to].map(|it| R::FIRST_SECTOR + (it / R::SECTOR as u32) as u8);
        self.change(|registers| {
            for sector in first..end {
                registers.erase(sector);
                registers.wait()?;
            }
            Ok(())
        })
    }

    #[inline(never)]
    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        check_write(self, offset, bytes.len())?;
        self.change(|registers| {
            registers.permit_writing();
            let mut address = R::START + offset;
            for at_once in bytes.chunks_exact(R::WORD) {
                for word in at_once.as_chunks().0 {
                    // SAFETY: `check_write` has found the address within the slots and aligned; nothing refers to them.
                    unsafe { (address as *mut u32).write_volatile(u32::from_le_bytes(*word)) };
                    address += 4;
                }
                registers.wait()?;
            }
            Ok(())
        })
    }
}

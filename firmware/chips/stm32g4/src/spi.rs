//! The words of a SPI with its FIFOs (RM0440, chapter SPI: "Data transmission and reception procedures").
//!
//! The width of an access to the data register decides how many words it moves: a wide access with words of a
//! byte moves two. The flag of received words comes with the second byte unless FRXTH is set.

#![allow(unsafe_code)] // fields without named values

use core::ops::Deref;

use painleve_image::sensor_bus::{Overrun, SpiWords};

use crate::pac::spi1::RegisterBlock;

/// Clock edge at which bits are sampled; the clock rests low.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SampledAt {
    /// SPI mode 0.
    FirstEdge,
    /// SPI mode 1.
    SecondEdge,
}

/// Bits of a word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Word {
    /// 8 bits.
    Byte,
    /// 16 bits.
    HalfWord,
}

impl Word {
    /// Returns the number of bits.
    pub const fn bits(self) -> u8 {
        match self {
            Self::Byte => 8,
            Self::HalfWord => 16,
        }
    }
}

/// A SPI master.
pub struct SpiPort<I> {
    spi: I,
    word: Word,
}

impl<I: Deref<Target = RegisterBlock>> SpiPort<I> {
    /// Configures a SPI, whose clock is on, as a master at its bus' clock divided by 2^(`divider` + 1), 0 to 7.
    pub fn new(spi: I, word: Word, sampled: SampledAt, divider: u8) -> Self {
        spi.cr1().write(|w| {
            // SAFETY: three bits.
            unsafe { w.br().bits(divider & 7) };
            w.cpha().bit(sampled == SampledAt::SecondEdge);
            w.mstr().set_bit().ssm().set_bit().ssi().set_bit()
        });
        spi.cr2().write(|w| {
            // SAFETY: a number of bits, less one.
            unsafe { w.ds().bits(word.bits() - 1) };
            w.frxth().bit(word == Word::Byte)
        });
        Self { spi, word }
    }

    fn read(&self) -> u16 {
        match self.word {
            Word::Byte => self.spi.dr8().read().dr().bits().into(),
            Word::HalfWord => self.spi.dr().read().dr().bits(),
        }
    }
}

impl<I: Deref<Target = RegisterBlock>> SpiWords for SpiPort<I> {
    fn start(&mut self) {
        self.spi.cr2().modify(|_, w| w.rxneie().set_bit());
        self.spi.cr1().modify(|_, w| w.spe().set_bit());
    }

    fn send(&mut self, word: u16) {
        match self.word {
            Word::Byte => {
                self.spi.dr8().write(|w| w.dr().set(word as u8));
            }
            Word::HalfWord => {
                self.spi.dr().write(|w| w.dr().set(word));
            }
        }
    }

    fn receive(&mut self) -> Option<Result<u16, Overrun>> {
        let flags = self.spi.sr().read();
        if flags.rxne().bit_is_clear() {
            return None;
        }
        let word = self.read();
        if flags.ovr().bit_is_set() {
            // Reading data, then flags, clears an overrun.
            let _ = self.spi.sr().read();
            return Some(Err(Overrun));
        }
        Some(Ok(word))
    }

    fn discard(&mut self) {
        // The FIFO holds four bytes.
        for _ in 0..4 {
            if self.spi.sr().read().rxne().bit_is_clear() {
                return;
            }
            let _ = self.read();
        }
    }
}

//! USART1 with DMA for both directions.

#![allow(unsafe_code)] // addresses for DMA

use core::sync::atomic::AtomicU8;

use painleve_image::dma_serial::DmaRegisters;
use stm32f4xx_hal::pac::{self, DMA2, USART1};

/// Streams and channel of USART1 (RM0090, table 43).
const RECEIVER: usize = 2;
const TRANSMITTER: usize = 7;
const CHANNEL: u8 = 4;

/// The flag's bit in the status register.
const TRANSMISSION_COMPLETE: u16 = 1 << 6;

/// A configured serial port, and DMA2, whose clock is on.
pub struct UartDma {
    usart: USART1,
    dma: DMA2,
}

impl UartDma {
    /// Takes ownership of both.
    pub fn new(usart: USART1, dma: DMA2) -> Self {
        Self { usart, dma }
    }

    fn data_address(&self) -> u32 {
        self.usart.dr().as_ptr() as u32
    }
}

impl DmaRegisters for UartDma {
    fn receive_into(&mut self, buffer: &'static [AtomicU8]) {
        let receiver = self.dma.st(RECEIVER);
        // SAFETY: the address of a register, and address and length of a static buffer whose bytes may change at any time.
        unsafe {
            receiver.par().write(|w| w.bits(self.data_address()));
            receiver.m0ar().write(|w| w.bits(buffer.as_ptr() as u32));
            receiver.ndtr().write(|w| w.bits(buffer.len() as u32));
        }
        receiver.cr().write(|w| {
            // SAFETY: channels have three bits.
            unsafe { w.chsel().bits(CHANNEL) };
            w.minc().set_bit().circ().set_bit().en().set_bit()
        });
        self.usart
            .cr3()
            .modify(|_, w| w.dmar().set_bit().dmat().set_bit());
        self.usart.cr1().modify(|_, w| w.idleie().set_bit());
    }

    fn bytes_to_end() -> usize {
        // SAFETY: a load; the register belongs to the receiving stream.
        unsafe { (*DMA2::ptr()).st(RECEIVER).ndtr().read().bits() as usize }
    }

    fn acknowledge(&mut self) {
        let flags = self.usart.sr().read();
        if flags.idle().bit_is_set() || flags.ore().bit_is_set() {
            // Reading flags, then data, clears both. DMA moves the byte itself.
            let _ = self.usart.dr().read();
        }
    }

    fn has_sent(&self) -> bool {
        self.usart.sr().read().tc().bit_is_set()
    }

    fn send(&mut self, bytes: &[u8]) {
        self.dma.hifcr().write(|w| {
            w.ctcif7().set_bit().chtif7().set_bit().cteif7().set_bit();
            w.cdmeif7().set_bit().cfeif7().set_bit()
        });
        let stream = self.dma.st(TRANSMITTER);
        // SAFETY: the address of a register, and address and length of a buffer that stays unchanged meanwhile, by the
        // contract of the trait.
        unsafe {
            stream.par().write(|w| w.bits(self.data_address()));
            stream.m0ar().write(|w| w.bits(bytes.as_ptr() as u32));
            stream.ndtr().write(|w| w.bits(bytes.len() as u32));
        }
        // SAFETY: writing zero clears a flag, writing one leaves it unchanged.
        self.usart
            .sr()
            .write(|w| unsafe { w.bits(!TRANSMISSION_COMPLETE) });
        stream.cr().write(|w| {
            // SAFETY: channels have three bits.
            unsafe { w.chsel().bits(CHANNEL) };
            w.minc()
                .set_bit()
                .dir()
                .memory_to_peripheral()
                .en()
                .set_bit()
        });
        self.usart.cr1().modify(|_, w| w.tcie().set_bit());
    }

    fn rest(&mut self) {
        self.usart.cr1().modify(|_, w| w.tcie().clear_bit());
    }

    fn pend() {
        rtic::pend(pac::Interrupt::USART1);
    }
}

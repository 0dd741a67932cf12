//! USART1 with DMA for both directions.
//!
//! Where DMA2 does not answer, as under QEMU, the port's interrupt moves the bytes through the same buffers.

#![allow(unsafe_code)] // addresses for DMA

use core::sync::atomic::{AtomicU8, AtomicUsize, Ordering};

use cortex_m::peripheral::NVIC;
use painleve_image::dma_serial::DmaRegisters;
use stm32f4xx_hal::pac::{self, DMA2, USART1};

/// Streams and channel of USART1 (RM0090, table 43).
const RECEIVER: usize = 2;
const TRANSMITTER: usize = 7;
const CHANNEL: u8 = 4;

/// Without DMA, the number of bytes to the end of the receiver's buffer; 0 with DMA, which counts them itself.
static WITHOUT_DMA: AtomicUsize = AtomicUsize::new(0);

/// A configured serial port, and DMA2, whose clock is on.
pub struct UartDma {
    usart: USART1,
    dma: DMA2,
    received: &'static [AtomicU8],
}

impl UartDma {
    /// Takes ownership of both.
    pub fn new(usart: USART1, dma: DMA2) -> Self {
        Self {
            usart,
            dma,
            received: &[],
        }
    }

    fn data_address(&self) -> u32 {
        self.usart.dr().as_ptr() as u32
    }

    /// Puts what has been received into the buffer, as DMA would.
    fn move_bytes(&mut self) {
        let length = self.received.len();
        // A sender that is faster raises the interrupt again.
        for _ in 0..length {
            let to_end = WITHOUT_DMA.load(Ordering::Relaxed);
            if to_end == 0 || self.usart.sr().read().rxne().bit_is_clear() {
                return;
            }
            let byte = self.usart.dr().read().dr().bits() as u8;
            if let Some(place) = self.received.get(length - to_end) {
                place.store(byte, Ordering::Relaxed);
            }
            let left = if to_end > 1 { to_end - 1 } else { length };
            WITHOUT_DMA.store(left, Ordering::Relaxed);
        }
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
        if receiver.ndtr().read().bits() == 0 {
            self.received = buffer;
            WITHOUT_DMA.store(buffer.len(), Ordering::Relaxed);
            self.usart.cr1().modify(|_, w| w.rxneie().set_bit());
            return;
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
        match WITHOUT_DMA.load(Ordering::Relaxed) {
            // SAFETY: a load; the register belongs to the receiving stream.
            0 => unsafe { (*DMA2::ptr()).st(RECEIVER).ndtr().read().bits() as usize },
            to_end => to_end,
        }
    }

    fn acknowledge(&mut self) {
        self.move_bytes();
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
        if WITHOUT_DMA.load(Ordering::Relaxed) != 0 {
            // QEMU accepts all at once, and raises no interrupt for them.
            for byte in bytes {
                self.usart.dr().write(|w| w.dr().set((*byte).into()));
            }
            return Self::pend();
        }
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
        self.usart.sr().write(|w| w.tc().clear_bit());
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
        NVIC::pend(pac::Interrupt::USART1);
    }
}

//! USART1 at 921,600 baud, 8N1, with DMA for both directions: no byte is lost while the control task
//! runs.
//!
//! Received bytes go to a ring buffer. The idle line and every control tick wake the link task, which may
//! be late by a whole buffer: 11 ms.

#![allow(unsafe_code)] // buffers that DMA reads and writes

use heapless::spsc::{Consumer, Producer, Queue};
use stm32f4xx_hal::pac::{self, DMA2, USART1};

use painleve_image::board::{Bytes, Port};

/// Line speed, bit/s.
pub const BAUD: u32 = 921_600;

/// Number of received bytes that may wait.
const RECEIVED: usize = 1024;

/// Number of bytes that may wait to be sent.
const TO_SEND: usize = 512;

/// Largest number of bytes in one transfer.
const CHUNK: usize = 128;

/// Streams and channel of USART1 (RM0090, table 43).
const RECEIVER: usize = 2;
const TRANSMITTER: usize = 7;
const CHANNEL: u8 = 4;

/// The flag's bit in the status register.
const TRANSMISSION_COMPLETE: u16 = 1 << 6;

/// The interrupt's end of the port.
pub struct DmaBytes {
    usart: USART1,
    chunk: &'static mut [u8; CHUNK],
    to_send: Consumer<'static, u8>,
    is_sending: bool,
}

/// The link task's end of the port.
pub struct DmaPort {
    received: &'static [u8; RECEIVED],
    /// Index of the next byte to read.
    taken: usize,
    to_send: Producer<'static, u8>,
}

/// Takes ownership of a configured serial port, and of DMA2, whose clock is on; `None` on the second
/// call.
pub fn split(usart: USART1, dma: &DMA2) -> Option<(DmaBytes, DmaPort)> {
    let received = cortex_m::singleton!(RECEIVED_BYTES: [u8; RECEIVED] = [0; RECEIVED])?;
    let chunk = cortex_m::singleton!(SENT_BYTES: [u8; CHUNK] = [0; CHUNK])?;
    let queue = cortex_m::singleton!(TO_SEND_BYTES: Queue<u8, TO_SEND> = Queue::new())?;
    let (producer, consumer) = queue.split();
    let data = usart.dr().as_ptr() as u32;
    let receiver = dma.st(RECEIVER);
    // SAFETY: the address of a register, and address and length of a static buffer.
    unsafe {
        receiver.par().write(|w| w.bits(data));
        receiver.m0ar().write(|w| w.bits(received.as_ptr() as u32));
        receiver.ndtr().write(|w| w.bits(RECEIVED as u32));
        dma.st(TRANSMITTER).par().write(|w| w.bits(data));
        dma.st(TRANSMITTER)
            .m0ar()
            .write(|w| w.bits(chunk.as_ptr() as u32));
    }
    receiver.cr().write(|w| {
        // SAFETY: channels have three bits.
        unsafe { w.chsel().bits(CHANNEL) };
        w.minc().set_bit().circ().set_bit().en().set_bit()
    });
    usart
        .cr3()
        .modify(|_, w| w.dmar().set_bit().dmat().set_bit());
    usart.cr1().modify(|_, w| w.idleie().set_bit());
    Some((
        DmaBytes {
            usart,
            chunk,
            to_send: consumer,
            is_sending: false,
        },
        DmaPort {
            received,
            taken: 0,
            to_send: producer,
        },
    ))
}

impl Bytes for DmaBytes {
    fn serve(&mut self) {
        let flags = self.usart.sr().read();
        if flags.idle().bit_is_set() || flags.ore().bit_is_set() {
            // Reading flags, then data, clears both. DMA moves the byte itself.
            let _ = self.usart.dr().read();
        }
        if self.is_sending && flags.tc().bit_is_clear() {
            return;
        }
        self.is_sending = false;
        let mut length = 0;
        for place in self.chunk.iter_mut() {
            let Some(byte) = self.to_send.dequeue() else {
                break;
            };
            *place = byte;
            length += 1;
        }
        if length == 0 {
            self.usart.cr1().modify(|_, w| w.tcie().clear_bit());
            return;
        }
        self.send_chunk(length);
    }
}

impl DmaBytes {
    fn send_chunk(&mut self, length: u32) {
        self.is_sending = true;
        // SAFETY: this stream has finished, and nothing else uses it.
        let dma = unsafe { &*DMA2::ptr() };
        dma.hifcr().write(|w| {
            w.ctcif7().set_bit().chtif7().set_bit().cteif7().set_bit();
            w.cdmeif7().set_bit().cfeif7().set_bit()
        });
        let stream = dma.st(TRANSMITTER);
        // SAFETY: the length does not exceed the buffer's.
        stream.ndtr().write(|w| unsafe { w.bits(length) });
        // SAFETY: writing zero clears a flag, writing one leaves it unchanged.
        self.usart
            .sr()
            .write(|w| unsafe { w.bits(!TRANSMISSION_COMPLETE) });
        // Complete the stores to memory before DMA reads it.
        cortex_m::asm::dmb();
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
}

impl Port for DmaPort {
    const HALF_DUPLEX: bool = false;

    fn receive(&mut self, buffer: &mut [u8]) -> usize {
        // SAFETY: a load; the register belongs to the receiving stream.
        let left = unsafe { (*DMA2::ptr()).st(RECEIVER).ndtr().read().bits() } as usize;
        let filled = RECEIVED.saturating_sub(left);
        let mut length = 0;
        for place in buffer {
            if self.taken == filled % RECEIVED {
                break;
            }
            // SAFETY: within the buffer; DMA writes elsewhere, unless this is late by a whole buffer.
            *place = unsafe { self.received.as_ptr().add(self.taken).read_volatile() };
            self.taken = (self.taken + 1) % RECEIVED;
            length += 1;
        }
        length
    }

    fn send(&mut self, bytes: &[u8]) -> bool {
        if self.to_send.capacity() - self.to_send.len() < bytes.len() {
            return false;
        }
        for byte in bytes {
            let _ = self.to_send.enqueue(*byte);
        }
        rtic::pend(pac::Interrupt::USART1);
        true
    }
}

//! A serial port with DMA for both directions: no byte is lost while the control task runs.
//!
//! Received bytes go to a ring buffer. The idle line and every control tick wake the link task, which may be
//! late by a whole buffer: 11 ms at 921,600 baud.

use core::marker::PhantomData;
use core::sync::atomic::{AtomicU8, Ordering, compiler_fence};

use heapless::spsc::{Consumer, Producer, Queue};

use crate::port::Port;

/// Line speed of the link to the host, bit/s.
pub const BAUD: u32 = 921_600;

/// Number of received bytes that may wait.
const RECEIVED: usize = 1024;

/// Length of the queue of bytes to be sent, one more than may wait.
const TO_SEND: usize = 512;

/// Largest number of bytes in one transfer.
const CHUNK: usize = 128;

/// The registers of a serial port and of its two DMA channels.
pub trait DmaRegisters {
    /// Starts to receive into this buffer, round and round, and to raise the interrupt when the line is idle.
    fn receive_into(&mut self, buffer: &'static [AtomicU8]);

    /// Returns the number of bytes to the end of the receiver's buffer.
    fn bytes_to_end() -> usize;

    /// Clears the flags of an idle line and of lost bytes.
    fn acknowledge(&mut self);

    /// Returns whether the last transfer has left the port.
    fn has_sent(&self) -> bool;

    /// Starts to send; raises the interrupt when done. The last transfer has left the port, and the bytes stay
    /// unchanged until this one has.
    fn send(&mut self, bytes: &[u8]);

    /// Stops the interrupt of completed transfers.
    fn rest(&mut self);

    /// Raises the port's interrupt.
    fn pend();
}

/// The interrupt's end of the port.
pub struct DmaBytes<R> {
    registers: R,
    chunk: &'static mut [u8; CHUNK],
    to_send: Consumer<'static, u8>,
    is_sending: bool,
}

/// The link task's end of the port.
pub struct DmaPort<R> {
    /// DMA writes it meanwhile.
    received: &'static [AtomicU8; RECEIVED],
    /// Index of the next byte to read.
    taken: usize,
    to_send: Producer<'static, u8>,
    registers: PhantomData<R>,
}

/// Takes ownership of a configured serial port; `None` on the second call.
pub fn split<R: DmaRegisters>(mut registers: R) -> Option<(DmaBytes<R>, DmaPort<R>)> {
    let received = cortex_m::singleton!(
        RECEIVED_BYTES: [AtomicU8; RECEIVED] = [const { AtomicU8::new(0) }; RECEIVED]
    )?;
    let chunk = cortex_m::singleton!(SENT_BYTES: [u8; CHUNK] = [0; CHUNK])?;
    let queue = cortex_m::singleton!(TO_SEND_BYTES: Queue<u8, TO_SEND> = Queue::new())?;
    let (producer, consumer) = queue.split();
    let received: &'static [AtomicU8; RECEIVED] = received;
    registers.receive_into(received);
    let bytes = DmaBytes {
        registers,
        chunk,
        to_send: consumer,
        is_sending: false,
    };
    let port = DmaPort {
        received,
        taken: 0,
        to_send: producer,
        registers: PhantomData,
    };
    Some((bytes, port))
}

impl<R: DmaRegisters> DmaBytes<R> {
    /// Moves bytes between the port and its buffers.
    pub fn serve(&mut self) {
        self.registers.acknowledge();
        if self.is_sending && !self.registers.has_sent() {
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
        match self.chunk.get(..length) {
            Some(bytes) if length > 0 => {
                self.is_sending = true;
                // Complete the stores to memory before DMA reads it.
                cortex_m::asm::dmb();
                self.registers.send(bytes);
            }
            _ => self.registers.rest(),
        }
    }
}

impl<R: DmaRegisters> Port for DmaPort<R> {
    fn receive(&mut self, buffer: &mut [u8]) -> usize {
        let filled = RECEIVED.saturating_sub(R::bytes_to_end());
        // Keeps the loads of the bytes after that of their number.
        compiler_fence(Ordering::Acquire);
        let mut length = 0;
        for place in buffer {
            let waiting = self.received.get(self.taken);
            let Some(byte) = waiting.filter(|_| self.taken != filled % RECEIVED) else {
                break;
            };
            *place = byte.load(Ordering::Relaxed);
            self.taken = (self.taken + 1) % RECEIVED;
            length += 1;
        }
        length
    }

    fn send(&mut self, bytes: &[u8], spare: usize) -> bool {
        if self.to_send.capacity() - self.to_send.len() < bytes.len() + spare {
            return false;
        }
        for byte in bytes {
            let _ = self.to_send.enqueue(*byte);
        }
        R::pend();
        true
    }
}

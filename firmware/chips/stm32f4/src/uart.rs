//! USART1 with a buffer in each direction, at 921,600 baud, 8N1.
//!
//! The interrupt moves single bytes, 11 µs apart. The link task moves them in bulk and may be late
//! by a whole buffer: 5.5 ms.

use cortex_m::peripheral::NVIC;
use heapless::spsc::{Consumer, Producer, Queue};
use stm32f4xx_hal::nb;
use stm32f4xx_hal::pac::{Interrupt, USART1};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::serial::{Rx, RxListen, Serial, Tx, TxISR, TxListen};

use painleve_image::board::{Bytes, Port};

/// Line speed, bit/s.
pub const BAUD: u32 = 921_600;

/// Capacity of the buffer in each direction, bytes.
const CAPACITY: usize = 512;

/// The interrupt's end of the port.
pub struct UartBytes {
    receiver: Rx<USART1>,
    transmitter: Tx<USART1>,
    received: Producer<'static, u8>,
    to_send: Consumer<'static, u8>,
}

/// The link task's end of the port.
pub struct UartPort {
    received: Consumer<'static, u8>,
    to_send: Producer<'static, u8>,
}

/// Takes ownership of the serial port; `None` on the second call.
pub fn split(serial: Serial<USART1>) -> Option<(UartBytes, UartPort)> {
    let in_queue = cortex_m::singleton!(RECEIVED: Queue<u8, CAPACITY> = Queue::new())?;
    let out_queue = cortex_m::singleton!(TO_SEND: Queue<u8, CAPACITY> = Queue::new())?;
    let (received_in, received_out) = in_queue.split();
    let (to_send_in, to_send_out) = out_queue.split();
    let (transmitter, mut receiver) = serial.split();
    receiver.listen();
    Some((
        UartBytes {
            receiver,
            transmitter,
            received: received_in,
            to_send: to_send_out,
        },
        UartPort {
            received: received_out,
            to_send: to_send_in,
        },
    ))
}

impl Bytes for UartBytes {
    fn serve(&mut self) {
        loop {
            // A damaged byte, an overrun or a full buffer spoils the message, which the checksum
            // detects. Reading the data register clears the error, which would otherwise raise the
            // interrupt forever.
            match self.receiver.read() {
                Ok(byte) => {
                    let _ = self.received.enqueue(byte);
                }
                Err(nb::Error::Other(_)) => {}
                Err(nb::Error::WouldBlock) => break,
            }
        }
        // At most two bytes on the chip; all of them under QEMU, which accepts bytes at once and
        // raises no interrupt for them.
        while self.transmitter.is_tx_empty() {
            let Some(byte) = self.to_send.dequeue() else {
                return self.transmitter.unlisten();
            };
            let _: nb::Result<(), _> = self.transmitter.write(byte);
        }
        self.transmitter.listen();
    }
}

impl Port for UartPort {
    const HALF_DUPLEX: bool = false;

    fn receive(&mut self, buffer: &mut [u8]) -> usize {
        let mut length = 0;
        for place in buffer {
            let Some(byte) = self.received.dequeue() else {
                break;
            };
            *place = byte;
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
        // The interrupt sends the first byte and then enables itself as needed.
        NVIC::pend(Interrupt::USART1);
        true
    }
}

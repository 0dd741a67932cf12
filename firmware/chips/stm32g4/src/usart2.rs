//! USART2 with DMA for both directions, through the request multiplexer (RM0440, chapters USART, DMA and DMAMUX).

#![allow(unsafe_code)] // addresses for DMA

use core::sync::atomic::AtomicU8;

use cortex_m::peripheral::NVIC;
use painleve_image::dma_serial::DmaRegisters;

use crate::pac::{DMA1, DMAMUX, Interrupt, USART2};

/// Channels of DMA1, from 0, which are those of the multiplexer as well.
const RECEIVER: usize = 0;
const TRANSMITTER: usize = 1;

/// Requests of USART2 (RM0440, chapter DMAMUX: "Assignment of multiplexer inputs to resources").
const RECEIVED: u8 = 26;
const TO_SEND: u8 = 27;

/// USART2 with two channels of DMA1.
pub struct Usart2Dma {
    usart: USART2,
    dma: DMA1,
}

impl Usart2Dma {
    /// Configures the port for 8N1 at `baud`. The clocks of all three are on, `bus_hz` is that of APB1.
    pub fn new(usart: USART2, dma: DMA1, multiplexer: &DMAMUX, bus_hz: u32, baud: u32) -> Self {
        // SAFETY: numbers of requests; a divisor of 16 bits.
        unsafe {
            let request = |channel: usize, id| {
                multiplexer.ccr(channel).write(|w| w.dmareq_id().bits(id));
            };
            request(RECEIVER, RECEIVED);
            request(TRANSMITTER, TO_SEND);
            usart.brr().write(|w| w.bits((bus_hz + baud / 2) / baud));
        }
        usart.cr3().write(|w| w.dmar().set_bit().dmat().set_bit());
        usart
            .cr1()
            .write(|w| w.ue().set_bit().re().set_bit().te().set_bit());
        Self { usart, dma }
    }
}

impl DmaRegisters for Usart2Dma {
    fn receive_into(&mut self, buffer: &'static [AtomicU8]) {
        let channel = self.dma.ch(RECEIVER);
        // SAFETY: the address of a register, and address and length of a static buffer whose bytes may change at any time.
        unsafe {
            let data = self.usart.rdr().as_ptr() as u32;
            channel.par().write(|w| w.bits(data));
            channel.mar().write(|w| w.bits(buffer.as_ptr() as u32));
            channel.ndtr().write(|w| w.bits(buffer.len() as u32));
        }
        channel
            .cr()
            .write(|w| w.minc().set_bit().circ().set_bit().en().set_bit());
        self.usart.cr1().modify(|_, w| w.idleie().set_bit());
    }

    fn bytes_to_end() -> usize {
        // SAFETY: a load; the register belongs to the receiving channel.
        unsafe { (*DMA1::ptr()).ch(RECEIVER).ndtr().read().bits() as usize }
    }

    fn acknowledge(&mut self) {
        self.usart
            .icr()
            .write(|w| w.idlecf().clear_bit_by_one().orecf().clear_bit_by_one());
    }

    fn has_sent(&self) -> bool {
        self.usart.isr().read().tc().bit_is_set()
    }

    fn send(&mut self, bytes: &[u8]) {
        let channel = self.dma.ch(TRANSMITTER);
        // A channel is configured while it is off.
        channel.cr().write(|w| w.en().clear_bit());
        // SAFETY: the address of a register, and address and length of a buffer that stays unchanged meanwhile, by the
        // contract of the trait.
        unsafe {
            let data = self.usart.tdr().as_ptr() as u32;
            channel.par().write(|w| w.bits(data));
            channel.mar().write(|w| w.bits(bytes.as_ptr() as u32));
            channel.ndtr().write(|w| w.bits(bytes.len() as u32));
        }
        self.usart.icr().write(|w| w.tccf().clear_bit_by_one());
        channel
            .cr()
            .write(|w| w.minc().set_bit().dir().set_bit().en().set_bit());
        self.usart.cr1().modify(|_, w| w.tcie().set_bit());
    }

    fn rest(&mut self) {
        self.usart.cr1().modify(|_, w| w.tcie().clear_bit());
    }

    fn pend() {
        NVIC::pend(Interrupt::USART2);
    }
}

//! Drivers without a bus: a driver names the next exchange and takes its answer.
//!
//! A board lets interrupts carry the exchanges, so that no byte is waited for; a PC carries them one after
//! the other with [`PolledDriver`]. Both execute the same driver.

use embedded_hal::delay::DelayNs;
use embedded_hal::digital::OutputPin;
use embedded_hal::spi::SpiBus;

/// One exchange with a part: select it, send and receive, deselect it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Exchange {
    /// Index of the part's select pin.
    pub select: usize,
    /// Bits to send, right-aligned, most significant first; their number is [`Dialogue::BITS`].
    pub data: u32,
}

/// Minimum times around an exchange, ns.
#[derive(Clone, Copy, Debug)]
pub struct SelectTiming {
    /// From select low to the first clock edge.
    pub setup_ns: u32,
    /// From the last clock edge to select high.
    pub hold_ns: u32,
    /// From select high to the next select low.
    pub pause_ns: u32,
}

/// A driver: the exchanges that give one set of readings.
pub trait Dialogue {
    /// Bits of an exchange, a multiple of 8 up to 24.
    const BITS: u8;
    /// Times around each exchange.
    const TIMING: SelectTiming;
    /// Largest number of exchanges of one set of readings, with one sensor on each channel and with two.
    const MOST_EXCHANGES: [u32; 2];

    /// Starts a new set of readings; returns its first exchange.
    fn begin(&mut self) -> Exchange;

    /// Takes the answer of the last exchange, right-aligned, `None` if the bus failed. Returns the next
    /// exchange; `None` when the readings are complete.
    fn proceed(&mut self, answer: Option<u32>) -> Option<Exchange>;
}

/// A driver on a bus of its own that waits for every byte, for a PC.
pub struct PolledDriver<D, B, S, T, const N: usize> {
    driver: D,
    bus: B,
    selects: [S; N],
    delay: T,
}

impl<D: Dialogue, B: SpiBus, S: OutputPin, T: DelayNs, const N: usize> PolledDriver<D, B, S, T, N> {
    /// Takes a driver with its bus and select pins, which are active low and already high.
    pub fn new(driver: D, bus: B, selects: [S; N], delay: T) -> Self {
        Self {
            driver,
            bus,
            selects,
            delay,
        }
    }

    /// Takes a set of readings; returns the driver, which holds them.
    pub fn read(&mut self) -> &D {
        let mut next = Some(self.driver.begin());
        while let Some(exchange) = next {
            let answer = self.carry_out(exchange);
            next = self.driver.proceed(answer);
        }
        &self.driver
    }

    fn carry_out(&mut self, exchange: Exchange) -> Option<u32> {
        let select = self.selects.get_mut(exchange.select)?;
        let mut bytes = exchange.data.to_be_bytes();
        let sent = bytes.get_mut(4 - usize::from(D::BITS / 8)..)?;
        select.set_low().ok()?;
        self.delay.delay_ns(D::TIMING.setup_ns);
        let bus = &mut self.bus;
        let done = bus.transfer_in_place(sent).and_then(|()| bus.flush());
        self.delay.delay_ns(D::TIMING.hold_ns);
        select.set_high().ok()?;
        self.delay.delay_ns(D::TIMING.pause_ns);
        done.ok()?;
        // The bytes before the first that was received are zero.
        Some(u32::from_be_bytes(bytes))
    }
}

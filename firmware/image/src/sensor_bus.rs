//! A SPI bus whose exchanges are carried by its interrupt: nothing waits for a byte.
//!
//! The interrupt comes with every received word. Between two exchanges it waits for the parts' set-up, hold
//! and pause times, a microsecond together.

use cortex_m::peripheral::DWT;
use embedded_hal::digital::OutputPin;
use painleve_drivers::exchange::{Dialogue, Exchange};

/// A SPI master that sends and receives words of a fixed length, and raises its interrupt with every received
/// word.
pub trait SpiWords {
    /// Switches the port and its interrupt on.
    fn start(&mut self);

    /// Sends a word, right-aligned.
    fn send(&mut self, word: u16);

    /// Takes the received word; `None` if there is none.
    fn receive(&mut self) -> Option<Result<u16, Overrun>>;

    /// Discards received words.
    fn discard(&mut self);
}

/// A word was lost because the one before had not been taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Overrun;

/// Words and waits of a bus.
#[derive(Clone, Copy, Debug)]
pub struct BusTiming {
    /// The processor's clock, Hz.
    pub core_hz: u32,
    /// The bus' clock on the wire, Hz.
    pub bus_hz: u32,
    /// Bits of a word, 8 or 16, for which the SPI is configured.
    pub word_bits: u8,
}

/// Processor cycles of the waits.
#[derive(Clone, Copy, Debug)]
struct Waits {
    setup: u32,
    hold: u32,
    pause: u32,
}

/// A bus with its driver.
pub struct SensorBus<W, S, D, const N: usize> {
    words: W,
    selects: [S; N],
    dialogue: D,
    word_bits: u8,
    words_per_exchange: u8,
    waits: Waits,
    /// Bits still to send, and received so far.
    sending: u32,
    received: u32,
    words_left: u8,
    selected: usize,
    has_failed: bool,
    is_busy: bool,
}

impl<W, S, D, const N: usize> SensorBus<W, S, D, N>
where
    W: SpiWords,
    S: OutputPin,
    D: Dialogue,
{
    /// Takes a SPI that is configured as a master, and select pins that are high.
    pub fn new(mut words: W, selects: [S; N], dialogue: D, timing: BusTiming) -> Self {
        let cycles = |ns: u32| ns * (timing.core_hz / 1_000_000) / 1000 + 1;
        // The last word is received at its last sampling edge, half a period before the clock rests.
        let half_period_ns = 500_000_000 / timing.bus_hz.max(1) + 1;
        let times = D::TIMING;
        words.start();
        Self {
            words,
            selects,
            dialogue,
            word_bits: timing.word_bits,
            words_per_exchange: D::BITS / timing.word_bits.max(1),
            waits: Waits {
                setup: cycles(times.setup_ns),
                hold: cycles(times.hold_ns + half_period_ns),
                pause: cycles(times.pause_ns),
            },
            sending: 0,
            received: 0,
            words_left: 0,
            selected: 0,
            has_failed: false,
            is_busy: false,
        }
    }

    /// Selects the first part of a new set of readings, unless the last one is still under way. Returns
    /// whether it did: [`send`](Self::send) is then due after the set-up time.
    fn select_first(&mut self) -> bool {
        let starts = !self.is_busy;
        if starts {
            self.is_busy = true;
            self.select();
        }
        starts
    }

    /// Returns the driver, to change what it reads; [`restart`](Self::restart) is due then.
    pub fn driver_mut(&mut self) -> &mut D {
        &mut self.dialogue
    }

    /// Gives up whatever is under way, and starts a new set of readings.
    pub fn restart(&mut self) {
        for select in &mut self.selects {
            let _ = select.set_high();
        }
        self.words.discard();
        self.is_busy = false;
        self.prepare();
        self.select_first();
        set_up(DWT::cycle_count(), self.waits.setup);
        self.send();
    }

    /// Prepares the next set of readings, so that it can start at once; those of the last set have been taken.
    #[inline]
    pub fn prepare(&mut self) {
        let exchange = self.dialogue.begin();
        self.load(exchange);
    }

    /// Serves the interrupt: takes a received word, sends the next. Returns the driver when its set of readings
    /// is complete; [`prepare`](Self::prepare) is due after they have been taken.
    pub fn serve(&mut self) -> Option<&D> {
        let received = self.words.receive()?;
        self.has_failed |= received.is_err();
        let word = received.unwrap_or_default();
        self.received = self.received << self.word_bits | u32::from(word);
        self.words_left = self.words_left.saturating_sub(1);
        if self.words_left > 0 {
            self.send();
            return None;
        }
        self.close();
        let answer = (!self.has_failed).then_some(self.received);
        match self.dialogue.proceed(answer) {
            Some(exchange) => {
                self.load(exchange);
                self.select();
                set_up(DWT::cycle_count(), self.waits.setup);
                self.send();
                None
            }
            None => {
                self.is_busy = false;
                Some(&self.dialogue)
            }
        }
    }

    /// Takes over the data of an exchange.
    #[inline]
    fn load(&mut self, exchange: Exchange) {
        self.selected = exchange.select;
        self.sending = exchange.data << (32 - u32::from(D::BITS));
        self.received = 0;
        self.has_failed = false;
        self.words_left = self.words_per_exchange;
    }

    #[inline]
    fn select(&mut self) {
        if let Some(select) = self.selects.get_mut(self.selected) {
            let _ = select.set_low();
        }
    }

    #[inline]
    fn close(&mut self) {
        self.hold();
        if let Some(select) = self.selects.get_mut(self.selected) {
            let _ = select.set_high();
        }
        self.pause();
    }

    // One function for each wait, so that the bound of the interrupt finds them by their names.

    #[inline]
    fn hold(&self) {
        wait(self.waits.hold);
    }

    #[inline]
    fn pause(&self) {
        wait(self.waits.pause);
    }

    fn send(&mut self) {
        let word = self.sending >> (32 - u32::from(self.word_bits));
        self.sending <<= self.word_bits;
        self.words.send(word as u16);
    }
}

/// New sets of readings on two buses whose first parts are selected.
#[must_use]
pub struct Selected {
    one: bool,
    other: bool,
    at_cycle: u32,
}

/// Selects the first parts of new sets of readings on two buses, except where the last one is still under way.
pub fn select_both<W1, S1, D1, const N1: usize, W2, S2, D2, const N2: usize>(
    one: &mut SensorBus<W1, S1, D1, N1>,
    other: &mut SensorBus<W2, S2, D2, N2>,
) -> Selected
where
    W1: SpiWords,
    S1: OutputPin,
    D1: Dialogue,
    W2: SpiWords,
    S2: OutputPin,
    D2: Dialogue,
{
    Selected {
        one: one.select_first(),
        other: other.select_first(),
        at_cycle: DWT::cycle_count(),
    }
}

/// Starts the selected sets of readings, once the parts' set-up times have passed since they were selected.
pub fn send_both<W1, S1, D1, const N1: usize, W2, S2, D2, const N2: usize>(
    one: &mut SensorBus<W1, S1, D1, N1>,
    other: &mut SensorBus<W2, S2, D2, N2>,
    selected: &Selected,
) where
    W1: SpiWords,
    S1: OutputPin,
    D1: Dialogue,
    W2: SpiWords,
    S2: OutputPin,
    D2: Dialogue,
{
    set_up(selected.at_cycle, one.waits.setup.max(other.waits.setup));
    if selected.one {
        one.send();
    }
    if selected.other {
        other.send();
    }
}

/// Waits until a part's set-up time has passed since it was selected.
#[inline]
fn set_up(selected_at_cycle: u32, cycles: u32) {
    wait_since(selected_at_cycle, cycles);
}

/// Waits for at least this many processor cycles.
#[inline]
fn wait(cycles: u32) {
    wait_since(DWT::cycle_count(), cycles);
}

/// Waits until at least this many processor cycles have passed since `start` by the cycle counter, which must run.
#[inline]
fn wait_since(start: u32, cycles: u32) {
    // Bounded even if the counter stands still.
    for _ in 0..cycles {
        if DWT::cycle_count().wrapping_sub(start) >= cycles {
            return;
        }
        // Keeps the compiler from unrolling the loop, which would make the last look later.
        cortex_m::asm::nop();
    }
}

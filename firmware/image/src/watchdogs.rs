//! An STM32's two watchdogs, fed at the end of every control tick.
//!
//! The window watchdog runs on the processor's clock and resets the chip one and a half periods after the last
//! finished tick. The independent watchdog runs on its own oscillator and covers a failure of the clock itself.

/// Keys of the independent watchdog: they start it for good, permit to change its limit, restart its time.
const START: u16 = 0xcccc;
const OPEN: u16 = 0x5555;
const FEED: u16 = 0xaaaa;

/// Number of polls for a limit to take effect, in the oscillator's time: after some 200 µs.
const PATIENCE: u32 = 100_000;

/// Cycles of the slow peripherals' clock per count of the window watchdog.
const WINDOW_CYCLES: f32 = 4096.0;

/// Limit of an independent watchdog.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IndependentLimit {
    /// Counts of 4 · 2ⁿ cycles.
    pub prescaler: u8,
    /// Counts, of twelve bits.
    pub reload: u16,
}

impl IndependentLimit {
    /// Returns the shortest limit of at least `limit_s`, whose oscillator has at most `fastest_hz`.
    pub fn new(limit_s: f32, fastest_hz: f32) -> Self {
        // Counts of four cycles, doubled until they fit into twelve bits.
        let mut counts = limit_s * fastest_hz / 4.0;
        let mut prescaler = 0;
        while counts > 4096.0 && prescaler < 6 {
            counts /= 2.0;
            prescaler += 1;
        }
        let reload = (counts as u16).clamp(1, 4095);
        Self { prescaler, reload }
    }
}

/// Limit of a window watchdog.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WindowLimit {
    /// Counts of 4096 · 2ⁿ cycles.
    pub prescaler: u8,
    /// The counter after feeding: the chip is reset when its bit 6 falls.
    pub counter: u8,
}

impl WindowLimit {
    /// Returns the limit of one and a half periods, on a bus of `bus_hz`, with prescalers up to
    /// `largest_prescaler`; `None` for periods that are too long.
    pub fn new(period_s: f32, bus_hz: f32, largest_prescaler: u8) -> Option<Self> {
        let mut counts = 1.5 * period_s * bus_hz / WINDOW_CYCLES;
        let mut prescaler = 0;
        while counts > 63.0 && prescaler < largest_prescaler {
            counts /= 2.0;
            prescaler += 1;
        }
        let counter = 0x40 | counts as u8;
        (counts <= 63.0).then_some(Self { prescaler, counter })
    }
}

/// Registers of the independent watchdog.
pub trait IndependentWatchdog {
    /// Highest frequency of its oscillator, Hz.
    const FASTEST_HZ: f32;

    /// Writes to the key register.
    fn write_key(&self, key: u16);

    /// Writes the registers of the limit.
    fn set(&self, limit: IndependentLimit);

    /// Returns whether the limit has taken effect.
    fn is_set(&self) -> bool;

    /// Starts the watchdog with a timeout of at least `limit_s`, or changes its timeout. Call it before anything
    /// that may hang.
    fn start(&self, limit_s: f32) {
        self.write_key(START);
        self.write_key(OPEN);
        self.set(IndependentLimit::new(limit_s, Self::FASTEST_HZ));
        let _ = (0..PATIENCE).any(|_| self.is_set());
        self.write_key(FEED);
    }
}

/// Registers of the window watchdog, whose clock must be on.
pub trait WindowWatchdog {
    /// Largest prescaler.
    const LARGEST_PRESCALER: u8;

    /// Sets the prescaler, and permits to feed at any time.
    fn set_prescaler(&self, prescaler: u8);

    /// Feeds the watchdog, which starts it for good.
    fn feed(&self, counter: u8);
}

/// Both watchdogs.
pub struct Watchdogs<I, W> {
    independent: I,
    window: W,
    bus_hz: f32,
    /// `None` for rates too low for the window watchdog.
    limit: Option<WindowLimit>,
}

impl<I: IndependentWatchdog, W: WindowWatchdog> Watchdogs<I, W> {
    /// Takes ownership of both watchdogs; `bus_hz` is the clock of the window watchdog's bus.
    pub fn new(independent: I, window: W, bus_hz: u32) -> Self {
        Self {
            independent,
            window,
            bus_hz: bus_hz as f32,
            limit: None,
        }
    }

    /// Sets the timeout of the window watchdog to one and a half of these periods, and that of the independent
    /// one to at least two.
    pub fn set_period(&mut self, period_s: f32) {
        self.independent.start(2.0 * period_s);
        let Some(limit) = WindowLimit::new(period_s, self.bus_hz, W::LARGEST_PRESCALER) else {
            // The running window watchdog cannot be stopped, and would reset the chip too early.
            return;
        };
        self.limit = Some(limit);
        self.window.set_prescaler(limit.prescaler);
        self.feed();
    }

    /// Feeds both watchdogs when a tick is finished.
    pub fn feed(&mut self) {
        self.independent.write_key(FEED);
        if let Some(WindowLimit { counter, .. }) = self.limit {
            self.window.feed(counter);
        }
    }
}

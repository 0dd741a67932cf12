//! An STM32's two watchdogs, fed at the beginning of every control tick, which the previous one has finished by then.
//!
//! The window watchdog runs on the processor's clock and resets the chip between one and two periods after the last
//! tick. The independent watchdog runs on its own oscillator and covers a failure of the clock itself.

use painleve_shared::message::RefusedRate;

/// Keys of the independent watchdog: they start it for good, permit to change its limit, restart its time.
const START: u16 = 0xcccc;
const OPEN: u16 = 0x5555;
const FEED: u16 = 0xaaaa;

/// Number of polls for a limit to take effect, in the oscillator's time: after some 200 µs.
const PATIENCE: u32 = 100_000;

/// Cycles of the slow peripherals' clock per count of the window watchdog.
const WINDOW_CYCLES: f32 = 4096.0;

/// Number of limits of the window watchdog, of six bits.
const COUNTS: f32 = 64.0;

/// Step of the search for other rates, relative, and the number of steps, which take less than half a millisecond.
const RATE_STEP: f32 = 0.01;
const RATE_STEPS: u32 = 300;

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
///
/// Its prescaler runs freely: the first count after feeding is shorter than the others by an unknown time. A limit
/// of n counts therefore expires between n and n + 1 counts after feeding.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WindowLimit {
    /// Counts of 4096 · 2ⁿ cycles.
    prescaler: u8,
    counts: u8,
    count_s: f32,
}

impl WindowLimit {
    /// Returns the limit in the middle between the shortest and the longest on a bus of `bus_hz`, or a longer one if that may
    /// expire before the shortest; `None` for limits that are too long.
    pub fn new(
        [shortest_s, longest_s]: [f32; 2],
        bus_hz: f32,
        largest_prescaler: u8,
    ) -> Option<Self> {
        let middle_s = (shortest_s + longest_s) / 2.0;
        let mut prescaler = 0;
        let mut count_s = WINDOW_CYCLES / bus_hz;
        while middle_s >= COUNTS * count_s {
            if prescaler == largest_prescaler {
                return None;
            }
            prescaler += 1;
            count_s *= 2.0;
        }
        // Rounding down centres the interval from n to n + 1 counts.
        let counts = (middle_s / count_s) as u8;
        Some(Self {
            prescaler,
            counts: counts + u8::from(f32::from(counts) * count_s < shortest_s),
            count_s,
        })
    }

    /// Returns whether the limit has expired two periods after feeding at the latest.
    pub fn is_within_two(&self, period_s: f32) -> bool {
        f32::from(self.counts + 1) * self.count_s <= 2.0 * period_s
    }

    /// The counter after feeding: the chip is reset when its bit 6 falls.
    fn counter(&self) -> u8 {
        0x40 | self.counts
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

    /// Starts the watchdog with a timeout of at least `limit_s`, or changes its timeout, and calls `meanwhile` until
    /// that has taken effect. Call it before anything that may hang.
    #[inline(never)]
    fn start(&self, limit_s: f32, meanwhile: impl Fn()) {
        self.write_key(START);
        // One that runs is not fed by its start.
        self.feed();
        self.write_key(OPEN);
        self.set(IndependentLimit::new(limit_s, Self::FASTEST_HZ));
        let _ = (0..PATIENCE).any(|_| {
            meanwhile();
            self.is_set()
        });
        self.feed();
    }

    /// Restarts its time.
    fn feed(&self) {
        self.write_key(FEED);
    }
}

/// Registers of the window watchdog, whose clock must be on.
pub trait WindowWatchdog {
    /// Largest prescaler.
    const LARGEST_PRESCALER: u8;
    /// Longest delay of a tick by a sensor's interrupt or by code that masks interrupts, s.
    const LATEST_FEED_S: f32;

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
    /// Counter of the window watchdog after feeding; `None` until it runs.
    counter: Option<u8>,
}

impl<I: IndependentWatchdog, W: WindowWatchdog> Watchdogs<I, W> {
    /// Takes ownership of both watchdogs; `bus_hz` is the clock of the window watchdog's bus.
    pub fn new(independent: I, window: W, bus_hz: u32) -> Self {
        Self {
            independent,
            window,
            bus_hz: bus_hz as f32,
            counter: None,
        }
    }

    /// Checks that the window watchdog has a limit for this rate. If the torque depends on the rate, the limit has to
    /// expire within two periods.
    ///
    /// # Errors
    /// The rate, and the nearest ones that have a limit, to a hundredth.
    #[inline(never)]
    pub fn check_rate(&self, tick_hz: f32, drives: bool) -> Result<(), RefusedRate> {
        let fits = |hz: &f32| {
            let period_s = 1.0 / hz;
            self.limit(period_s)
                .is_some_and(|limit| !drives || limit.is_within_two(period_s))
        };
        if fits(&tick_hz) {
            return Ok(());
        }
        let [below_hz, above_hz] = [1.0 - RATE_STEP, 1.0 + RATE_STEP].map(|factor| {
            let mut hz = tick_hz;
            for _ in 0..RATE_STEPS {
                hz *= factor;
                // Told as a whole number.
                if fits(&(hz as u32 as f32)) {
                    return hz as u32;
                }
            }
            0
        });
        Err(RefusedRate {
            tick_hz: tick_hz as u32,
            below_hz,
            above_hz,
        })
    }

    #[inline(never)]
    fn limit(&self, period_s: f32) -> Option<WindowLimit> {
        let shortest_s = period_s + W::LATEST_FEED_S;
        WindowLimit::new(
            [shortest_s, 2.0 * period_s],
            self.bus_hz,
            W::LARGEST_PRESCALER,
        )
    }

    /// Sets the timeouts for this period, that of the independent watchdog to at least two.
    pub fn set_period(&mut self, period_s: f32) {
        // The running window watchdog cannot be stopped: without a new limit, the last one stays.
        if let Some(limit) = self.limit(period_s) {
            self.window.set_prescaler(limit.prescaler);
            self.counter = Some(limit.counter());
        }
        // Its limit may be shorter than the time until that of the independent one has taken effect.
        self.feed_window();
        self.independent
            .start(2.0 * period_s, || self.feed_window());
        self.feed_window();
    }

    fn feed_window(&self) {
        if let Some(counter) = self.counter {
            self.window.feed(counter);
        }
    }

    /// Feeds both watchdogs at a tick.
    pub fn feed(&self) {
        self.independent.feed();
        self.feed_window();
    }
}

//! The times of the control ticks, with optional random jitter.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Random stream of the lateness, separate from those of the noise channels.
const STREAM: u64 = 0x4a69_7474_6572_0001;

/// Number and time of each tick.
#[derive(Clone, Debug)]
pub struct TickClock {
    tick_hz: f64,
    /// Largest lateness, in tick periods.
    jitter: f64,
    generator: Pcg64,
    tick: u64,
    /// Lateness of the present tick, in tick periods.
    late: f64,
    /// Lateness of the next tick.
    next_late: f64,
}

impl TickClock {
    /// Returns the nominal rate, Hz.
    pub fn tick_hz(&self) -> f64 {
        self.tick_hz
    }

    /// Creates a clock at tick 0, which is on time. Each later tick is late by up to `jitter` tick periods, uniformly.
    pub fn new(tick_hz: f64, jitter: f64, seed: u64) -> Self {
        let mut clock = Self {
            tick_hz,
            jitter,
            generator: Pcg64::seed_from_u64(seed ^ STREAM),
            tick: 0,
            late: 0.0,
            next_late: 0.0,
        };
        clock.next_late = clock.draw();
        clock
    }

    /// Returns the number of ticks since the start.
    pub fn tick(&self) -> u64 {
        self.tick
    }

    /// Returns the time that is `ticks` tick periods after this tick, limited to the next tick, s.
    #[inline]
    pub fn after_s(&self, ticks: f64) -> f64 {
        self.at_s((self.late + ticks).min(1.0 + self.next_late))
    }

    /// Returns the time that is `ticks` tick periods before the next tick, limited to this tick, s.
    #[inline]
    pub fn before_next_s(&self, ticks: f64) -> f64 {
        self.at_s((1.0 + self.next_late - ticks).max(self.late))
    }

    /// Advances to the next tick.
    #[inline]
    pub fn advance(&mut self) {
        self.tick += 1;
        self.late = self.next_late;
        self.next_late = self.draw();
    }

    // Computed from whole numbers, so that errors do not accumulate.
    #[inline]
    fn at_s(&self, ticks: f64) -> f64 {
        (self.tick as f64 + ticks) / self.tick_hz
    }

    #[inline]
    fn draw(&mut self) -> f64 {
        if self.jitter == 0.0 {
            return 0.0;
        }
        self.jitter * self.generator.random::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn without_jitter_every_tick_is_on_time() {
        let mut clock = TickClock::new(1000.0, 0.0, 1);
        (0..5).for_each(|_| clock.advance());
        assert_eq!(clock.after_s(0.25), 5.25 / 1000.0);
        assert_eq!(clock.before_next_s(0.25), 5.75 / 1000.0);
        assert_eq!(clock.before_next_s(0.0), 6.0 / 1000.0);
    }

    proptest! {
        #[test]
        fn ticks_are_late_by_at_most_the_jitter_and_in_order(
            jitter in 0.0_f64..0.9, ticks in 0.0_f64..1.0, seed: u64,
        ) {
            let mut clock = TickClock::new(100.0, jitter, seed);
            for tick in 0..100 {
                let (start_s, end_s) = (clock.after_s(0.0), clock.before_next_s(0.0));
                let late = start_s * 100.0 - f64::from(tick);
                prop_assert!((-1e-9..=jitter + 1e-9).contains(&late));
                prop_assert!(start_s <= clock.after_s(ticks) && clock.after_s(ticks) <= end_s);
                prop_assert!(start_s <= clock.before_next_s(ticks));
                clock.advance();
                prop_assert!((clock.after_s(0.0) - end_s).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn the_mean_lateness_is_half_the_jitter() {
        let mut clock = TickClock::new(1.0, 0.4, 3);
        let mut sum = 0.0;
        for tick in 0..10_000 {
            sum += clock.after_s(0.0) - f64::from(tick);
            clock.advance();
        }
        assert!((sum / 1e4 - 0.2).abs() < 5e-3, "{sum}");
    }
}

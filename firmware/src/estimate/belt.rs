//! What contact tells about the belt's speed.
//!
//! Coulomb friction shows only the direction of slip: while it is positive the belt is slower
//! than the tip, while it is negative faster, and in stick it is exactly as fast. The
//! observer keeps these bounds; they widen with the acceleration that the belt may have. Once
//! the tip has slid both ways, or stuck, they meet.

use painleve_shared::{OutOfRange, Real, Slip, check_setting, settings};

use crate::estimate::friction::FrictionEstimate;

settings! {
    /// Settings of the belt observer.
    #[derive(Copy)]
    pub struct BeltSettings {
        /// The belt's speed if it is known and constant; at most `fastest_m_s` either way.
        given_m_s: Option<f32> = None, -100.0..=100.0, "m/s";
        /// Fastest belt either way.
        fastest_m_s: f32 = 2.0, 1e-3..=100.0, "m/s";
        /// Largest acceleration of the belt.
        acceleration_m_s2: f32 = 2.0, 0.0..=1e3, "m/s²";
    }
    check Self::relations;
}

impl BeltSettings {
    fn relations(&self) -> Result<(), OutOfRange> {
        check_setting!(self.given_m_s, -self.fastest_m_s, self.fastest_m_s)
    }
}

/// Bounds of the belt's speed.
#[derive(Clone, Copy, Debug)]
pub struct BeltObserver {
    settings: BeltSettings,
    slowest_m_s: f32,
    fastest_m_s: f32,
}

impl BeltObserver {
    /// An observer that knows nothing but its settings.
    pub fn new(settings: &BeltSettings) -> Self {
        let (slowest_m_s, fastest_m_s) = settings
            .given_m_s
            .map_or((-settings.fastest_m_s, settings.fastest_m_s), |speed| {
                (speed, speed)
            });
        Self {
            settings: *settings,
            slowest_m_s,
            fastest_m_s,
        }
    }

    /// One tick of `tick_s`: the tip's velocity (m/s) and, in contact, what friction says.
    pub fn update(
        &mut self,
        tip_velocity_m_s: f32,
        friction: Option<&FrictionEstimate>,
        tick_s: f32,
    ) {
        if self.settings.given_m_s.is_some() {
            return;
        }
        let widening = self.settings.acceleration_m_s2 * tick_s;
        let limit = self.settings.fastest_m_s;
        self.slowest_m_s = (self.slowest_m_s - widening).at_least(-limit);
        self.fastest_m_s = (self.fastest_m_s + widening).at_most(limit);
        let Some(friction) = friction.filter(|friction| friction.slip_seen) else {
            return;
        };
        if friction.sticks || friction.slip == Slip::Positive {
            self.fastest_m_s = self.fastest_m_s.at_most(tip_velocity_m_s);
            self.slowest_m_s = self.slowest_m_s.at_most(self.fastest_m_s);
        }
        if friction.sticks || friction.slip == Slip::Negative {
            self.slowest_m_s = self.slowest_m_s.at_least(tip_velocity_m_s);
            self.fastest_m_s = self.fastest_m_s.at_least(self.slowest_m_s);
        }
    }

    /// Slowest and fastest speed that the belt may have, m/s.
    pub fn bounds_m_s(&self) -> (f32, f32) {
        (self.slowest_m_s, self.fastest_m_s)
    }

    /// Direction of slip of a tip with this velocity (m/s); `None` where the bounds leave it open.
    pub fn slip(&self, tip_velocity_m_s: f32) -> Option<Slip> {
        if tip_velocity_m_s > self.fastest_m_s {
            Some(Slip::Positive)
        } else if tip_velocity_m_s < self.slowest_m_s {
            Some(Slip::Negative)
        } else {
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn friction(slip: Slip, sticks: bool) -> FrictionEstimate {
        FrictionEstimate {
            coefficient: 0.6,
            deviation: 0.01,
            slip,
            slip_seen: true,
            sticks,
        }
    }

    #[test]
    fn sliding_both_ways_closes_the_bounds() {
        let mut belt = BeltObserver::new(&BeltSettings::default());
        assert_eq!(belt.slip(0.0), None);
        belt.update(0.1, Some(&friction(Slip::Positive, false)), 1e-3);
        assert_eq!(belt.slip(0.2), Some(Slip::Positive));
        belt.update(-0.3, Some(&friction(Slip::Negative, false)), 1e-3);
        let (slowest, fastest) = belt.bounds_m_s();
        assert!((slowest + 0.3).abs() < 1e-6 && (fastest - 0.102).abs() < 1e-3);
        assert_eq!(belt.slip(-0.4), Some(Slip::Negative));
    }

    #[test]
    fn stick_shows_the_speed_and_time_forgets_it() {
        let mut belt = BeltObserver::new(&BeltSettings::default());
        belt.update(-0.25, Some(&friction(Slip::Positive, true)), 1e-3);
        assert_eq!(belt.bounds_m_s(), (-0.25, -0.25));
        for _ in 0..100 {
            belt.update(0.0, None, 1e-3);
        }
        let (slowest, fastest) = belt.bounds_m_s();
        assert!((slowest + 0.45).abs() < 1e-3 && (fastest + 0.05).abs() < 1e-3);
    }

    #[test]
    fn a_belt_faster_than_its_bounds_moves_them() {
        let mut belt = BeltObserver::new(&BeltSettings::default());
        belt.update(-0.5, Some(&friction(Slip::Positive, false)), 1e-3);
        belt.update(0.5, Some(&friction(Slip::Negative, false)), 1e-3);
        assert_eq!(belt.bounds_m_s(), (0.5, 0.5));
    }

    #[test]
    fn a_given_speed_stays() {
        let mut belt = BeltObserver::new(&BeltSettings {
            given_m_s: Some(-0.4),
            ..Default::default()
        });
        belt.update(3.0, Some(&friction(Slip::Negative, false)), 1.0);
        assert_eq!(belt.bounds_m_s(), (-0.4, -0.4));
    }
}

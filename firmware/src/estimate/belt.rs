//! Bounds the belt's speed from contact.
//!
//! Coulomb friction shows only the direction of slip. At positive slip the belt is slower than the
//! tip, at negative slip it is faster, and in stick it is as fast as the tip. The estimator keeps
//! these bounds and widens them with the largest acceleration of the belt. After the tip has slid
//! in both directions, or stuck, the bounds meet.

use painleve_shared::{Real, Slip, settings};

use crate::estimate::friction::FrictionEstimate;

/// Error of the tip's velocity, m/s: slower, it is at rest. Half and twice of it lost more runs (lab book, *Factors on constants*).
pub const BOUND_ERROR_M_S: f32 = 0.01;

settings! {
    /// Settings of the belt-speed estimator.
    #[derive(Copy)]
    pub struct BeltSpeedSettings {
        /// Belt speed if it is known and constant.
        given_m_s: Option<f32> = None, -100.0..=100.0, "m/s";
        /// Largest acceleration of the belt.
        acceleration_m_s2: f32 = 2.0, 0.0..=1e3, "m/s²";
    }
}

/// Narrows the bounds of the belt's speed at each tick.
#[derive(Clone, Copy, Debug)]
pub struct BeltEstimator {
    /// Whether the speed is known.
    is_given: bool,
    /// Change of the belt's speed in one tick, m/s.
    widening_m_s: f32,
    /// Bounds of the belt's speed.
    slowest_m_s: f32,
    fastest_m_s: f32,
}

impl BeltEstimator {
    /// Makes an estimator that knows at most a given speed, and is called every `tick_s`.
    pub fn new(settings: &BeltSpeedSettings, tick_s: f32) -> Self {
        let given = settings.given_m_s;
        Self {
            is_given: given.is_some(),
            widening_m_s: settings.acceleration_m_s2 * tick_s,
            slowest_m_s: given.unwrap_or(f32::NEG_INFINITY),
            fastest_m_s: given.unwrap_or(f32::INFINITY),
        }
    }

    /// Updates the bounds `elapsed_ticks` after the last readings, with the tip's velocity (m/s) and, in contact, the
    /// friction estimate.
    #[inline]
    pub fn update(
        &mut self,
        tip_velocity_m_s: f32,
        friction: Option<&FrictionEstimate>,
        elapsed_ticks: u32,
    ) {
        if self.is_given {
            return;
        }
        let widening = self.widening_m_s * elapsed_ticks as f32;
        self.slowest_m_s -= widening;
        self.fastest_m_s += widening;
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

    /// Returns whether the bounds allow a belt as fast as a tip with this velocity (m/s), which is then in
    /// stick.
    pub fn may_stick(&self, tip_velocity_m_s: f32) -> bool {
        tip_velocity_m_s > self.slowest_m_s - BOUND_ERROR_M_S
            && tip_velocity_m_s < self.fastest_m_s + BOUND_ERROR_M_S
    }

    /// Returns the direction of slip of a tip at rest, if the bounds leave one.
    pub fn slip_at_rest(&self) -> Option<Slip> {
        (!self.may_stick(0.0)).then(|| Slip::of(-self.fastest_m_s))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    impl BeltEstimator {
        /// Returns the lowest and highest speed that the belt may have, m/s.
        fn bounds_m_s(&self) -> (f32, f32) {
            (self.slowest_m_s, self.fastest_m_s)
        }
    }

    fn friction(slip: Slip, sticks: bool) -> FrictionEstimate {
        FrictionEstimate {
            coefficient: 0.6,
            catch_up: 0.0,
            variance: 1e-4,
            slip,
            slip_seen: true,
            sticks,
        }
    }

    #[test]
    fn sliding_both_ways_closes_the_bounds() {
        let mut belt = BeltEstimator::new(&BeltSpeedSettings::default(), 1e-3);
        belt.update(0.1, Some(&friction(Slip::Positive, false)), 1);
        belt.update(-0.3, Some(&friction(Slip::Negative, false)), 1);
        let (slowest, fastest) = belt.bounds_m_s();
        assert!((slowest + 0.3).abs() < 1e-6 && (fastest - 0.102).abs() < 1e-3);
    }

    #[test]
    fn a_tip_as_fast_as_one_that_slid_lately_does_not_stick() {
        let mut belt = BeltEstimator::new(&BeltSpeedSettings::default(), 1e-3);
        assert!(belt.may_stick(0.0));
        belt.update(0.1, Some(&friction(Slip::Negative, false)), 1);
        assert!(!belt.may_stick(0.05) && belt.may_stick(0.095));
        assert!(belt.may_stick(0.4));
        // The belt may have slowed down meanwhile.
        for _ in 0..50 {
            belt.update(0.0, None, 1);
        }
        assert!(belt.may_stick(0.05));
    }

    #[test]
    fn stick_gives_the_speed_and_the_bounds_widen_with_time() {
        let mut belt = BeltEstimator::new(&BeltSpeedSettings::default(), 1e-3);
        belt.update(-0.25, Some(&friction(Slip::Positive, true)), 1);
        assert_eq!(belt.bounds_m_s(), (-0.25, -0.25));
        for _ in 0..50 {
            belt.update(0.0, None, 1);
        }
        // Lost frames take time as well.
        belt.update(0.0, None, 50);
        let (slowest, fastest) = belt.bounds_m_s();
        assert!((slowest + 0.45).abs() < 1e-3 && (fastest + 0.05).abs() < 1e-3);
    }

    #[test]
    fn the_slip_of_a_tip_at_rest_is_against_the_belt() {
        let mut belt = BeltEstimator::new(&BeltSpeedSettings::default(), 1e-3);
        assert_eq!(belt.slip_at_rest(), None);
        // Slip in one direction bounds the belt's speed on one side.
        belt.update(0.3, Some(&friction(Slip::Positive, false)), 1);
        assert_eq!(belt.slip_at_rest(), None);
        belt.update(-0.15, Some(&friction(Slip::Positive, false)), 1);
        assert_eq!(belt.slip_at_rest(), Some(Slip::Positive));
        // A tip that is thrown faster than the belt does not change that.
        belt.update(-0.2, Some(&friction(Slip::Negative, false)), 1);
        assert_eq!(belt.slip_at_rest(), Some(Slip::Positive));
        // In time the belt may have turned.
        for _ in 0..100 {
            belt.update(0.0, None, 1);
        }
        assert_eq!(belt.slip_at_rest(), None);
        let forwards = BeltSpeedSettings {
            given_m_s: Some(0.2),
            ..Default::default()
        };
        let slip = BeltEstimator::new(&forwards, 1e-3).slip_at_rest();
        assert_eq!(slip, Some(Slip::Negative));
    }

    #[test]
    fn a_belt_faster_than_its_bounds_moves_them() {
        let mut belt = BeltEstimator::new(&BeltSpeedSettings::default(), 1e-3);
        belt.update(-0.5, Some(&friction(Slip::Positive, false)), 1);
        belt.update(0.5, Some(&friction(Slip::Negative, false)), 1);
        assert_eq!(belt.bounds_m_s(), (0.5, 0.5));
    }

    #[test]
    fn a_given_speed_stays() {
        let mut belt = BeltEstimator::new(
            &BeltSpeedSettings {
                given_m_s: Some(-0.4),
                ..Default::default()
            },
            1.0,
        );
        belt.update(3.0, Some(&friction(Slip::Negative, false)), 1);
        assert_eq!(belt.bounds_m_s(), (-0.4, -0.4));
    }
}

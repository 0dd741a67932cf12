//! Checks whether readings can come from an arm while the drive is not armed.
//!
//! A sensor with cut lines reads all zeros or all ones, and a sensor that hangs repeats the same count. If
//! two selects are shorted, both encoders give the same angle. A drive armed on such readings would move an
//! arm that it cannot observe.

use painleve_shared::counts::{EncoderCounts, ForceCounts};

use crate::TURNS;

/// Number of checks before readings count as plausible: 50 ticks.
pub const CHECKS: u16 = 50 / TURNS as u16;

/// Reason why the drive must not be armed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Implausible {
    /// Not enough readings yet, or the last one was lost.
    NotYet,
    /// An encoder reads exactly all zeros or all ones.
    DeadLine,
    /// Both encoders read exactly the same.
    SameAngle,
    /// An encoder reports that its magnet is missing or too near, or has not been checked yet.
    Magnet,
    /// The force cell is at its limit.
    ForceLimit,
}

/// Readings of one tick; `None` for a lost reading.
#[derive(Clone, Copy, Debug, Default)]
pub struct SensorReadings {
    /// Both encoders, counts of `encoder_bits`.
    pub joints: [Option<EncoderCounts>; 2],
    /// Both forces, counts of `force_bits`.
    pub forces: [Option<ForceCounts>; 2],
    /// Whether both magnets are healthy; `None` before they are checked.
    pub magnets: [Option<bool>; 2],
}

impl SensorReadings {
    /// Returns whether no reading of this tick is lost.
    pub fn are_complete(&self) -> bool {
        self.joints.iter().all(Option::is_some) && self.forces.iter().all(Option::is_some)
    }
}

/// Checks readings every few ticks.
#[derive(Clone, Copy, Debug, Default)]
pub struct Plausibility {
    /// Checks in a row since a reading was missing.
    complete: u16,
    /// Checks in a row with both encoders at the same angle.
    same: u16,
    /// Checks in a row with an encoder at all zeros or all ones.
    dead: [u16; 2],
}

impl Plausibility {
    /// Records that a reading is missing at a tick without a check.
    #[inline]
    pub fn note_missing(&mut self) {
        self.complete = 0;
    }

    /// Checks the readings of one tick.
    ///
    /// # Errors
    /// [`Implausible`] gives the reason why the drive must not be armed on them.
    pub fn check(
        &mut self,
        readings: &SensorReadings,
        (encoder_bits, force_bits): (u8, u8),
    ) -> Result<(), Implausible> {
        let ones = (1_u32 << (encoder_bits & 31)) - 1;
        let count = |checks: u16, condition: bool| {
            if condition {
                checks.saturating_add(1)
            } else {
                0
            }
        };
        self.complete = count(self.complete, readings.are_complete());
        let [one, two] = readings.joints;
        let is_dead =
            |joint: Option<EncoderCounts>| joint.is_none_or(|it| it.0 == 0 || it.0 == ones);
        let [dead_1, dead_2] = self.dead;
        self.dead = [count(dead_1, is_dead(one)), count(dead_2, is_dead(two))];
        self.same = count(self.same, one.is_some() && one == two);
        if self.dead.iter().any(|it| *it >= CHECKS) {
            return Err(Implausible::DeadLine);
        }
        if self.same >= CHECKS {
            return Err(Implausible::SameAngle);
        }
        if self.complete < CHECKS {
            return Err(Implausible::NotYet);
        }
        match readings.magnets {
            [Some(true), Some(true)] => {}
            [Some(false), _] | [_, Some(false)] => return Err(Implausible::Magnet),
            _ => return Err(Implausible::NotYet),
        }
        let limit = (1_i32 << ((force_bits & 31).wrapping_sub(1) & 31)) - 1;
        let at_limit = |it: &Option<ForceCounts>| it.is_some_and(|it| it.0.abs() >= limit);
        if readings.forces.iter().any(at_limit) {
            return Err(Implausible::ForceLimit);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(checks: u16, joints: [u32; 2], force: i32, magnet: bool) -> Result<(), Implausible> {
        let readings = SensorReadings {
            joints: joints.map(|it| Some(EncoderCounts(it))),
            forces: [Some(ForceCounts(force)); 2],
            magnets: [Some(magnet); 2],
        };
        let mut plausibility = Plausibility::default();
        let mut verdict = Err(Implausible::NotYet);
        for _ in 0..checks {
            verdict = plausibility.check(&readings, (14, 13));
        }
        verdict
    }

    #[test]
    fn an_arm_at_rest_is_plausible_after_a_while() {
        assert_eq!(
            after(CHECKS - 1, [100, 200], -5, true),
            Err(Implausible::NotYet)
        );
        assert_eq!(after(CHECKS, [100, 200], -5, true), Ok(()));
    }

    #[test]
    fn cut_lines_shorted_selects_and_missing_magnets_are_implausible() {
        assert_eq!(after(CHECKS, [0, 200], 0, true), Err(Implausible::DeadLine));
        assert_eq!(
            after(CHECKS, [7, 16383], 0, true),
            Err(Implausible::DeadLine)
        );
        assert_eq!(
            after(CHECKS, [200, 200], 0, true),
            Err(Implausible::SameAngle)
        );
        assert_eq!(
            after(CHECKS, [100, 200], 0, false),
            Err(Implausible::Magnet)
        );
        assert_eq!(
            after(CHECKS, [100, 200], 4095, true),
            Err(Implausible::ForceLimit)
        );
        assert_eq!(
            after(CHECKS, [100, 200], -4096, true),
            Err(Implausible::ForceLimit)
        );
    }
}

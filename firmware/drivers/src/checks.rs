//! Checks of an arm that take seconds or many ticks to find something. They take turns, one part at a tick, so
//! that no tick is long; a verdict stays until the next one.

use painleve_shared::counts::TorqueCounts;

use crate::TURNS;
use crate::gap::GapCheck;
use crate::heating::{Heating, HeatingModel};
use crate::plausibility::{Implausible, Plausibility, SensorReadings};

/// What the checks have found at their last turns.
#[derive(Clone, Copy, Debug)]
pub struct Verdict {
    /// Whether readings contradict each other, those before, or the torques.
    pub contradiction: bool,
    /// Whether a winding is too hot.
    pub is_hot: bool,
    /// Whether the drive may be armed on these readings.
    pub plausible: Result<(), Implausible>,
}

/// The checks, with their state.
#[derive(Clone, Debug)]
pub struct Checks {
    bits: (u8, u8),
    gap: Option<GapCheck>,
    plausibility: Plausibility,
    heating_model: Option<HeatingModel>,
    heating: Heating,
    turn: u8,
    verdict: Verdict,
}

impl Checks {
    /// Makes checks; without an arm's model or a model of its windings, the checks that need it find nothing.
    /// `bits` are the resolutions of encoders and force cell.
    pub fn new(gap: Option<GapCheck>, heating_model: Option<HeatingModel>, bits: (u8, u8)) -> Self {
        Self {
            bits,
            gap,
            plausibility: Plausibility::default(),
            heating_model,
            heating: Heating::default(),
            turn: 0,
            verdict: Verdict {
                contradiction: false,
                is_hot: false,
                plausible: Err(Implausible::NotYet),
            },
        }
    }

    /// Takes over the temperatures of the windings from `others`.
    pub fn keep_heat_of(&mut self, others: &Self) {
        self.heating = others.heating.at_a_steps_start();
        self.verdict.is_hot = self.heating_model.is_some() && self.heating.is_hot();
    }

    /// Returns what the checks have found so far.
    #[inline]
    pub fn verdict(&self) -> &Verdict {
        &self.verdict
    }

    /// Records that a reading is missing at this tick, whichever check's turn it is.
    #[inline]
    pub fn note_missing(&mut self) {
        self.plausibility.note_missing();
    }

    /// Records the torques put out at a tick, and lets the check whose turn it is look at its readings. `drives`
    /// states whether the drive is active.
    pub fn tick(&mut self, readings: &SensorReadings, torques: [TorqueCounts; 2], drives: bool) {
        self.heating.tick(torques);
        self.turn = if self.turn + 1 < TURNS {
            self.turn + 1
        } else {
            0
        };
        match self.turn {
            0 => self.verdict.plausible = self.plausibility.check(readings, self.bits),
            1 => {
                if let Some(gap) = &mut self.gap {
                    gap.begin(readings, drives.then_some(torques));
                }
            }
            2 => {
                if let Some(gap) = &mut self.gap {
                    gap.measure();
                }
            }
            3 => {
                let gap = self.gap.as_mut();
                self.verdict.contradiction = gap.is_some_and(GapCheck::contradicts);
            }
            _ => {
                if let Some(model) = &self.heating_model {
                    self.heating.step(model);
                    self.verdict.is_hot = self.heating.is_hot();
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use painleve_shared::counts::{EncoderCounts, ForceCounts};

    use super::*;

    /// Returns the number of ticks until healthy readings are plausible.
    fn ticks_until_plausible(checks: &mut Checks) -> Option<u32> {
        let readings = SensorReadings {
            joints: [100, 200].map(|it| Some(EncoderCounts(it))),
            forces: [Some(ForceCounts(3)); 2],
            magnets: [Some(true); 2],
        };
        (1..=100).find(|_| {
            checks.tick(&readings, [TorqueCounts(0); 2], false);
            checks.verdict().plausible.is_ok()
        })
    }

    #[test]
    fn a_reading_that_is_missing_between_two_checks_counts() {
        let mut checks = Checks::new(None, None, (14, 13));
        assert_eq!(ticks_until_plausible(&mut checks), Some(50));
        checks.note_missing();
        // The verdict stays until the next check.
        for tick in 1..TURNS {
            assert_eq!(ticks_until_plausible(&mut checks), Some(1), "{tick}");
        }
        assert_eq!(ticks_until_plausible(&mut checks), Some(46));
    }
}
